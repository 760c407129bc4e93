# SPDX-License-Identifier: Apache-2.0
"""All home types: those of the manual in its order, then those that it lacks.

The tables stand in home_switch.py, home_switch_off.py, limit_switch.py, no_switch.py and
mechanical_end.py.
"""

from collections.abc import Mapping
from types import MappingProxyType

from .home_switch import (
    HS,
    HS_REVERSE,
    HS_REVERSE_Z_PULSE,
    HS_TOUCH_PROBE,
    HS_Z_PULSE,
    HSHS,
)
from .home_switch_off import (
    HS_OFF,
    HS_OFF_REVERSE,
    HS_OFF_REVERSE_Z_PULSE,
    HS_OFF_Z_PULSE,
)
from .limit_switch import (
    EXTERNAL_LS,
    EXTERNAL_LS_EXTERNAL_LS,
    EXTERNAL_LS_OFF,
    EXTERNAL_LS_REVERSE_Z_PULSE,
    LS,
    LS_LS,
    LS_OFF,
    LS_REVERSE_Z_PULSE,
    NEAR_LS,
    NEAR_LS_NEAR_LS,
    NEAR_LS_OFF,
    NEAR_LS_REVERSE_Z_PULSE,
)
from .mechanical_end import (
    MECHANICAL_END,
    MECHANICAL_END_HS,
    MECHANICAL_END_LS,
    MECHANICAL_END_REVERSE_Z_PULSE,
)
from .no_switch import CURRENT_POS, TOUCH_PROBE, Z_PULSE
from .procedure import Procedure
from .states import HomeType

PROCEDURES: Mapping[HomeType, Procedure] = MappingProxyType(
    {
        procedure.home_type: procedure
        for procedure in (
            HS,
            HS_Z_PULSE,
            HS_REVERSE_Z_PULSE,
            HSHS,
            HS_TOUCH_PROBE,
            HS_OFF,
            HS_OFF_Z_PULSE,
            HS_OFF_REVERSE_Z_PULSE,
            LS,
            LS_REVERSE_Z_PULSE,
            NEAR_LS,
            NEAR_LS_REVERSE_Z_PULSE,
            EXTERNAL_LS,
            EXTERNAL_LS_REVERSE_Z_PULSE,
            CURRENT_POS,
            Z_PULSE,
            TOUCH_PROBE,
            MECHANICAL_END,
            MECHANICAL_END_HS,
            MECHANICAL_END_LS,
            MECHANICAL_END_REVERSE_Z_PULSE,
            HS_REVERSE,
            HS_OFF_REVERSE,
            LS_OFF,
            NEAR_LS_OFF,
            EXTERNAL_LS_OFF,
            LS_LS,
            NEAR_LS_NEAR_LS,
            EXTERNAL_LS_EXTERNAL_LS,
        )
    }
)
