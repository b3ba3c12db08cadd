# SPDX-License-Identifier: Apache-2.0
"""MAVLink without ROS: what is said to a vehicle, and what it must do before it is believed."""
