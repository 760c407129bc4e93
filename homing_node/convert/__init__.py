# SPDX-License-Identifier: Apache-2.0
"""Reads the homing configuration of other controllers and gives it as ours.

One module for each kind of file: its mapping as a table (doc/convert.md shows it), how to
recognise it, and how to read it. What has no equal here becomes a remark, so that nothing is lost
in silence.
"""

from .converted import Converted, Unconvertible, yaml_text
from .kinds import KINDS, convert

__all__ = ['KINDS', 'Converted', 'Unconvertible', 'convert', 'yaml_text']
