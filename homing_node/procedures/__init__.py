# SPDX-License-Identifier: Apache-2.0
"""Home types as tables of plain data.

Theory of operation
===================

A table is a mapping step -> (motion, {event: next step}). Each step is a home state that is
published, with a phase if a state has several steps. Ways are relative to the homing direction:
*toward* along it, *away* against it. Two rules give a table its meaning:

1. **The present step decides.** The axis does the motion of its row. An event with an arrow in
   that row leads to the next step; any other event changes nothing. The first row is where a run
   begins. Events that are conditions (``HS_ON``, ``LS_ON``, ``LIMIT_AHEAD``) are tested when
   their row is entered, so they also say what the start position changes.
2. **The arrow into a row is the row's cause.** The arrow into ``HOME_SHIFT`` is the reference:
   where its event was is the home position. A row that waits for a Z-pulse or the touch probe
   takes only a position beyond its cause, and the homing reverse distance counts from the cause.

A home type is composed of its own rows and of fragments, the manual's shared pages: *limit
switches during homing*, *home switch initially on*, *limit switch initially on*, *home shift*.

WARNING: what is not in the tables
==================================

These rules hold for every table, so they stand once, in the core:

- Which edges count: the axis must have traveled the row's way at the edge's own time; an edge
  going away must be at that end of the flag where the axis came in (core/switch_events.py,
  flags.py).
- The way of an edge, and the wait until the feedback shows it (core/edge_queue.py, travel.py).
- The undo of an arrow: an edge of an earlier time that arrives late takes back the arrow of a
  later one (``Machine.edge``).
- What the rise of a limit does, by role, end and motion, if the row has no arrow for it
  (core/limits.py).
- A motion into a limit that is on is not started; two limits of a pair that are on together end
  the run (``LimitSwitches.blocking``, ``Machine._limits_contradict``). There is one reversal in
  a run (``Machine._advance``).
- ``REPEAT`` replaces the arrow into ``HOME_SHIFT`` while passes are left (core/passes.py), and
  passes that disagree are no home.
- Which latched position is the reference: the n-th pulse, their spacing, the margin to the edge
  that armed it (core/latches.py, movement.py).
- When the mechanical end is found (core/mechanical_end.py).
- Bounds of distance and time, following error, wrong direction (core/travel.py). They are tested
  before an event that the motion itself brings about.
- Pause, cancel, stop (core/machine.py); stale inputs (core/readings.py); the wait for the
  feedback to settle at the end (core/settling.py).

Modules
=======

states.py, events.py, motions.py: the words. steps.py, procedure.py: what a table is made of.
fragments.py: the shared parts. home_switch.py, home_switch_off.py, limit_switch.py, no_switch.py,
mechanical_end.py: the tables, each with its numbered steps in words. tables.py: all of them.

Sources: WMX3 manual, "Limit Switches During Homing", "Home Switch Initially Triggered", "Limit
Switch Initially Triggered" and the pages of the home types.
"""
