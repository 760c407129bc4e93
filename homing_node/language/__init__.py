# SPDX-License-Identifier: Apache-2.0
"""The language that says what in a message is an input: grammar, types, values from bytes.

A user writes ``<topic>#<value>``; doc/inputs.md has the grammar on one page. An expression goes
through three steps:

1. ``expression.py`` parses it once, when the parameter is read: syntax only.
2. ``resolve.py`` fits it to a message type, once that is known (``layout.py``): each field must
   exist, and the value must be a number. What is looked up by name stays to be found.
3. ``reader.py`` applies it to each message, on the serialized bytes: a message that repeats the
   one before is known by its bytes; any other is walked (``cdr.py``), and what is wanted of it is
   found by index and by name (``search.py``).

A mistake of the user is a `BadExpression`. A message in which the value is missing is a `Missing`:
what was written fits the type, but not this message. No ROS, no clock.
"""
