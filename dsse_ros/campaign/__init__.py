# SPDX-License-Identifier: Apache-2.0
"""Campaigns: planners on scenarios, thousands of missions of each, compared in pairs."""
