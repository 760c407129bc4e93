# SPDX-License-Identifier: Apache-2.0
"""The homing node as a managed node, with `lifecycle: true`.

- configure: the parameters are read and checked; a fault is logged, and the transition fails.
- activate: requests are accepted.
- deactivate: every axis makes a controlled stop, and requests are refused with NotActive.
- cleanup: the homes are forgotten.
- shutdown: as deactivate.

The services of the transitions are rclpy's. Its callbacks cannot wait without holding the
executor, so that the node answers nothing else while it stops its axes for `deactivate`; the
cycle goes on.
"""

import time
from collections.abc import Callable
from functools import partial
from typing import Any

from lifecycle_msgs.srv import ChangeState
from rclpy.lifecycle import LifecycleNodeMixin, LifecycleState, TransitionCallbackReturn

from .node import HomingNode

#: Longest wait until the axes rest, and how often it is looked, s.
PATIENCE, LOOK = 10.0, 0.01
NOT_YET = 'the node is not active; activate it first (lifecycle)'

SUCCESS, FAILURE = TransitionCallbackReturn.SUCCESS, TransitionCallbackReturn.FAILURE


class ManagedNode(LifecycleNodeMixin, HomingNode):
    """A homing node whose life others manage if its parameter `lifecycle` is true."""

    def __init__(self, **kwargs: Any) -> None:
        HomingNode.__init__(self, **kwargs)
        if self.configuration.lifecycle:
            self.permissions.inactive = NOT_YET
            LifecycleNodeMixin.__init__(self)
            for service in self.services:
                if service.srv_type is ChangeState:
                    service.callback = partial(self._change_state, service.callback)

    def _change_state(
        self, change: Callable[..., Any], request: ChangeState.Request, response: Any
    ) -> Any:
        """Make a transition; rclpy raises, and never answers, where the state has none such."""
        try:
            return change(request, response)
        except RuntimeError as error:
            asked = request.transition
            self.get_logger().warning(f'no transition {asked.label or asked.id}: {error}')
            response.success = False
            return response

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Check the present parameters."""
        faults = [fault for of_axis in self.faults.values() for fault in of_axis]
        for fault in faults:
            self.get_logger().error(f'not configured: {fault}')
        return FAILURE if faults else super().on_configure(state)

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Accept requests from now on."""
        self.permissions.inactive = ''
        return super().on_activate(state)

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Refuse requests from now on, and stop every axis."""
        return super().on_deactivate(state) if self._stop_axes() else FAILURE

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Forget every home."""
        self.forget_homes()
        return super().on_cleanup(state)

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Stop every axis; the node accepts no requests any more."""
        return super().on_shutdown(state) if self._stop_axes() else FAILURE

    def _stop_axes(self) -> bool:
        """Stop every axis, and wait; return whether all of them rest."""
        self.permissions.inactive = NOT_YET
        self.cancel_all()
        until = time.monotonic() + PATIENCE
        while not self.at_rest:
            if time.monotonic() > until:
                self.get_logger().error(
                    f'the axes do not rest {PATIENCE:g} s after a stop; the node stays active for '
                    'the lifecycle, and refuses requests until it is deactivated and activated'
                )
                return False
            time.sleep(LOOK)
        return True
