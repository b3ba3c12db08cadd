# SPDX-License-Identifier: Apache-2.0
"""How Hypothesis looks for examples."""

from hypothesis import HealthCheck, settings

# Where the machine is busy, an example or its making that takes long is no failure.
settings.register_profile(
    "random", deadline=None, print_blob=True, suppress_health_check=[HealthCheck.too_slow]
)
# Another example in each run is tried with --hypothesis-profile=random.
settings.register_profile("same", settings.get_profile("random"), derandomize=True, database=None)
settings.load_profile("same")
