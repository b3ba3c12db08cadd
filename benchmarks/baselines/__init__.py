# SPDX-License-Identifier: Apache-2.0
"""One program per environment: the package here and the two published ones."""
