# SPDX-License-Identifier: Apache-2.0
"""The profile of properties."""

from hypothesis import settings

# The machine may be busy: an example that takes long is no failure.
settings.register_profile("mission", deadline=None)
settings.load_profile("mission")
