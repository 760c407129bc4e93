# SPDX-License-Identifier: Apache-2.0
"""The rules of rclpy 7.1.9 for coroutines, put into the rclpy that is installed.

Users of apt's Jazzy have rclpy 7.1.9 or newer; PyPI has 7.1.6. The rules differ in four points:

- `Future.__await__` yields the future itself while the future is pending.
- A task whose coroutine yielded a future is resumed when that future is done. The future must
  belong to the executor of the task, or to none.
- A task whose coroutine yielded None is resumed in the next spin, and the executor is woken for
  it. A coroutine that yields None while it waits makes the executor spin without a pause.
- `Executor._tasks` does not exist. There are `_pending_tasks` and `_ready_tasks`.

Import this module before the node: it changes the process that imports it, and `main` runs the
node there. At its end the process prints how often a coroutine yielded None.
"""

import atexit
import inspect

from rclpy.executors import Executor
from rclpy.task import Future, Task

from homing_node.ros.main import main

__all__ = ['main']

#: The task of each time that a coroutine yielded None.
yielded_none = []

_call_function = Task.__call__
_init = Executor.__init__


def _await(future):
    if not (future.done() or future.cancelled()):
        yield future
    return future.result()


def _call(task):
    """Run a task, or the next step of its coroutine."""
    if not inspect.iscoroutine(task._handler):
        return _call_function(task)
    if task._executing or not task._task_lock.acquire(blocking=False):
        return None
    task._executing = True
    try:
        if not (task.done() or task.cancelled()):
            _step(task)
    finally:
        task._executing = False
        task._task_lock.release()


def _step(task):
    try:
        yielded = task._handler.send(None)
    except StopIteration as end:
        task.set_result(end.value)
        task._complete_task()
    except Exception as error:
        task.set_exception(error)
        task._complete_task()
    else:
        _suspend(task, yielded)


def _suspend(task, yielded):
    executor = task._executor()
    if isinstance(yielded, Future):
        owner = yielded._executor()
        if owner is None:
            yielded._set_executor(executor)
        elif owner is not executor:
            raise RuntimeError('a task can only await futures of its own executor')
        yielded.add_done_callback(lambda _: task())
    elif yielded is None:
        yielded_none.append(task)
        executor._call_task_in_next_spin(task)
    else:
        raise TypeError(f'a coroutine must yield a Future or None, not {type(yielded)}')


class _Pending(dict):
    """Tasks that have not ended, each with its entity and node."""

    def append(self, entry):
        """Add an entry as rclpy 7.1.6 does: its executor has a list of entries."""
        self[entry[0]] = entry


def _create(executor, context=None):
    executor._pending_tasks, executor._ready_tasks = _Pending(), []
    _init(executor, context=context)


def _create_task(executor, callback, *args, **kwargs):
    task = Task(callback, args, kwargs, executor=executor)
    with executor._tasks_lock:
        executor._pending_tasks[task] = (task, None, None)
    executor._call_task_in_next_spin(task)
    return task


def _call_task_in_next_spin(executor, task):
    with executor._tasks_lock:
        executor._ready_tasks.append(task)
        executor._guard.trigger()


def _take_ready(executor):
    """Return the entries of the tasks that are ready, once; the caller holds the lock."""
    pending = executor._pending_tasks
    for task in [task for task in pending if task.done() or task.cancelled()]:
        del pending[task]
    ready, executor._ready_tasks = executor._ready_tasks, []
    return [pending[task] for task in ready if task in pending]


def _put_back(executor, entries):
    executor._ready_tasks = [entry[0] for entry in entries] + executor._ready_tasks


def _rename(name, new):
    """Let a method of the executor use another attribute instead of `_tasks`."""
    function = getattr(Executor, name)
    names = tuple(new if word == '_tasks' else word for word in function.__code__.co_names)
    assert new in names, f'Executor.{name} of this rclpy does not use _tasks'
    function.__code__ = function.__code__.replace(co_names=names)


def _drop_tasks(executor, value):
    """Ignore the list that the constructor of rclpy 7.1.6 makes."""


_rename('_make_handler', '_pending_tasks')
_rename('_wait_for_ready_callbacks', '_tasks_that_are_ready')
_rename('__init__', '_list_of_7_1_6')
Executor._tasks_that_are_ready = property(_take_ready, _put_back)
Executor._list_of_7_1_6 = property(None, _drop_tasks)
Executor.__init__ = _create
Executor.create_task = _create_task
Executor._call_task_in_next_spin = _call_task_in_next_spin
Task.__call__ = _call
Future.__await__ = _await
atexit.register(lambda: print(f'coroutines yielded None {len(yielded_none)} times', flush=True))
