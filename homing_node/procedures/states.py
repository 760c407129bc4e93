# SPDX-License-Identifier: Apache-2.0
"""The fixed words of homing: states, home types, errors, limit switch actions, inputs.

Every value is the string that users see, as the WMX3 manual spells it where the manual has it.
"""

from enum import Enum


class TextEnum(str, Enum):
    """An enumeration whose members print as their value."""

    __str__ = str.__str__


class State(TextEnum):
    """Home states, published as they stand (WMX3 manual, home states)."""

    Idle = 'Idle'
    HSSearch = 'HSSearch'
    HSAndZPulseSearch = 'HSAndZPulseSearch'
    HSOffSearch = 'HSOffSearch'
    HSOffAndZPulseSearch = 'HSOffAndZPulseSearch'
    LSSearch = 'LSSearch'
    ZPulseSearch = 'ZPulseSearch'
    ZPulseSearchReverse = 'ZPulseSearchReverse'
    HSClearReverse = 'HSClearReverse'
    HSFallingEdgeSearchReverse = 'HSFallingEdgeSearchReverse'
    LSFallingEdgeSearchReverse = 'LSFallingEdgeSearchReverse'
    SecondHSSearch = 'SecondHSSearch'
    TouchProbeSearch = 'TouchProbeSearch'
    MechanicalEndDetection = 'MechanicalEndDetection'
    HomeShift = 'HomeShift'
    Cancel = 'Cancel'
    Squaring = 'Squaring'
    Proving = 'Proving'
    Jogging = 'Jogging'


class HomeType(TextEnum):
    """Home types; the first fourteen are those of the manual's page on limit switches.

    The last eight are not WMX3's: an edge on the slow way back, and a second, slow pass over a
    limit switch.
    """

    HS = 'HS'
    HSZPulse = 'HSZPulse'
    HSReverseZPulse = 'HSReverseZPulse'
    HSHS = 'HSHS'
    HSTouchProbe = 'HSTouchProbe'
    HSOff = 'HSOff'
    HSOffZPulse = 'HSOffZPulse'
    HSOffReverseZPulse = 'HSOffReverseZPulse'
    LS = 'LS'
    LSReverseZPulse = 'LSReverseZPulse'
    NearLS = 'NearLS'
    NearLSReverseZPulse = 'NearLSReverseZPulse'
    ExternalLS = 'ExternalLS'
    ExternalLSReverseZPulse = 'ExternalLSReverseZPulse'
    CurrentPos = 'CurrentPos'
    ZPulse = 'ZPulse'
    TouchProbe = 'TouchProbe'
    MechanicalEndDetection = 'MechanicalEndDetection'
    MechanicalEndDetectionHS = 'MechanicalEndDetectionHS'
    MechanicalEndDetectionLS = 'MechanicalEndDetectionLS'
    MechanicalEndDetectionReverseZPulse = 'MechanicalEndDetectionReverseZPulse'
    HSReverse = 'HSReverse'
    HSOffReverse = 'HSOffReverse'
    LSOff = 'LSOff'
    NearLSOff = 'NearLSOff'
    ExternalLSOff = 'ExternalLSOff'
    LSLS = 'LSLS'
    NearLSNearLS = 'NearLSNearLS'
    ExternalLSExternalLS = 'ExternalLSExternalLS'


class Error(TextEnum):
    """Why a run ended or a request was refused; the first five are the manual's."""

    NoError = 'NoError'
    LSTriggered = 'LSTriggered'
    MaxLSRevDistanceTraveled = 'MaxLSRevDistanceTraveled'
    MaxHSOnAtStartRevDistanceTraveled = 'MaxHSOnAtStartRevDistanceTraveled'
    ZPulseDistanceCheckError = 'ZPulseDistanceCheckError'
    LimitsBothOn = 'LimitsBothOn'
    SearchDistanceExceeded = 'SearchDistanceExceeded'
    ZPulseNotFound = 'ZPulseNotFound'
    EdgeNotRepeated = 'EdgeNotRepeated'
    IndexMarginError = 'IndexMarginError'
    HomeMoved = 'HomeMoved'
    NotHomed = 'NotHomed'
    SkewTooLarge = 'SkewTooLarge'
    FollowerSwitchMissing = 'FollowerSwitchMissing'
    NotSquare = 'NotSquare'
    IndexAmbiguous = 'IndexAmbiguous'
    Timeout = 'Timeout'
    Canceled = 'Canceled'
    EmergencyStop = 'EmergencyStop'
    FeedbackStale = 'FeedbackStale'
    SwitchStale = 'SwitchStale'
    SwitchUnknown = 'SwitchUnknown'
    PublisherConflict = 'PublisherConflict'
    NoController = 'NoController'
    FollowingError = 'FollowingError'
    AxisMoving = 'AxisMoving'
    WrongDirection = 'WrongDirection'
    HandoverFailed = 'HandoverFailed'
    HomeLost = 'HomeLost'
    ServoOff = 'ServoOff'
    CycleLate = 'CycleLate'
    Busy = 'Busy'
    InvalidParameter = 'InvalidParameter'
    UnknownAxis = 'UnknownAxis'
    InternalError = 'InternalError'
    NotActive = 'NotActive'
    UnknownCell = 'UnknownCell'
    CellLost = 'CellLost'
    ResultLost = 'ResultLost'
    PrerequisiteMissing = 'PrerequisiteMissing'
    CoordinatorConflict = 'CoordinatorConflict'


class LSType(TextEnum):
    """What a limit switch does on its rising edge (WMX3 manual, LS Type)."""

    none = 'None'
    ServoOff = 'ServoOff'
    DecServoOff = 'DecServoOff'
    Dec = 'Dec'
    SlowDecServoOff = 'SlowDecServoOff'
    SlowDec = 'SlowDec'
    SeparatePositiveLSNegativeLS = 'SeparatePositiveLSNegativeLS'


class IndexMarginAction(TextEnum):
    """What to do if the edge that arms the Z-pulse lies too close to a pulse."""

    none = 'None'
    Warn = 'Warn'
    Fail = 'Fail'


class FeedbackClock(TextEnum):
    """Which time of a feedback message is the time at which it was sampled."""

    auto = 'auto'
    stamp = 'stamp'
    arrival = 'arrival'


class Encoder(TextEnum):
    """What the feedback still knows after the drive was off."""

    incremental = 'incremental'
    single_turn = 'single_turn'
    absolute = 'absolute'


class Restore(TextEnum):
    """Whether a home is taken over from before a restart of the node."""

    never = 'never'
    verify = 'verify'
    trust = 'trust'


class Apply(TextEnum):
    """How the rest of the machine gets the home of an axis."""

    none = 'none'
    service = 'service'
    relay = 'relay'


class Direction(TextEnum):
    """The homing direction in raw coordinates."""

    Positive = 'Positive'
    Negative = 'Negative'

    @property
    def sign(self) -> float:
        return 1.0 if self is Direction.Positive else -1.0


class LSDirection(TextEnum):
    """Whether the positive limit input sits at the positive end (WMX3 manual, LS Direction)."""

    Normal = 'Normal'
    Reverse = 'Reverse'


class LimitPair(TextEnum):
    """The three pairs of limit switches of an axis."""

    HARDWARE = 'hardware'
    NEAR = 'near'
    EXTERNAL = 'external'


class Role(TextEnum):
    """What a limit switch ahead means to a home type (WMX3 manual's page)."""

    REVERSAL = 'reversal'
    REFERENCE = 'reference'
    NORMAL = 'normal'
    IGNORED = 'ignored'


class Input(TextEnum):
    """The inputs of an axis; the value is the topic's last part and the name in `switches`."""

    HOME_SWITCH = 'home_switch'
    POSITIVE_LIMIT_SWITCH = 'positive_limit_switch'
    NEGATIVE_LIMIT_SWITCH = 'negative_limit_switch'
    NEAR_POSITIVE_LIMIT_SWITCH = 'near_positive_limit_switch'
    NEAR_NEGATIVE_LIMIT_SWITCH = 'near_negative_limit_switch'
    EXTERNAL_POSITIVE_LIMIT_SWITCH = 'external_positive_limit_switch'
    EXTERNAL_NEGATIVE_LIMIT_SWITCH = 'external_negative_limit_switch'
    Z_PULSE = 'z_pulse'
    TOUCH_PROBE = 'touch_probe'
    SERVO_ENABLED = 'servo_enabled'

    @property
    def text(self) -> str:
        return self.value.replace('_', ' ')


#: The positive and the negative input of each pair of limit switches.
LIMIT_PAIRS: dict[LimitPair, tuple[Input, Input]] = {
    LimitPair.HARDWARE: (Input.POSITIVE_LIMIT_SWITCH, Input.NEGATIVE_LIMIT_SWITCH),
    LimitPair.NEAR: (Input.NEAR_POSITIVE_LIMIT_SWITCH, Input.NEAR_NEGATIVE_LIMIT_SWITCH),
    LimitPair.EXTERNAL: (
        Input.EXTERNAL_POSITIVE_LIMIT_SWITCH,
        Input.EXTERNAL_NEGATIVE_LIMIT_SWITCH,
    ),
}

LIMIT_SWITCHES: tuple[Input, ...] = tuple(i for pair in LIMIT_PAIRS.values() for i in pair)
LATCHES: tuple[Input, ...] = (Input.Z_PULSE, Input.TOUCH_PROBE)
