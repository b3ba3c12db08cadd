# SPDX-License-Identifier: Apache-2.0
"""The report of a recorded mission: its numbers, figures and page."""
