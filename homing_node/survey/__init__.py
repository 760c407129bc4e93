# SPDX-License-Identifier: Apache-2.0
"""A survey: where things are on a real axis, from passes over its switches in both ways.

Theory of operation
===================

An axis goes over every switch in both ways, at two velocities (plan.py). Each pass brings the
edges that it met, with how far each may be off. What is unknown besides is how late the driver of
a switch is: an edge that is met at velocity v lies v times that delay behind its place, so the
edges met at two velocities bound the delay, and both together bound the place (edges.py). Where
the switch rises on one way and falls on the other are two edges; their distance is the hysteresis.

What comes out is a layout for `homing check` and the rehearsal, how far each of its numbers may be
off, doubts that only a person can settle, and in words what could not be seen (judgement.py,
report.py). No ROS, no clock, no I/O; positions are raw, in m or rad, times in s.
"""
