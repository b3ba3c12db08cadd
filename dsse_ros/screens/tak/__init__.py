# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A search as Cursor on Target, for ATAK and its kin."""

import warnings

# pytak misses it for PKCS#12 files and enrolment, which are not used here.
warnings.filterwarnings("ignore", "The 'cryptography' package is required", UserWarning)
