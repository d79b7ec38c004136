"""An arm in MuJoCo beside a floor and a wall, moved by a controller of trajectories, as a node."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import asdict, dataclass
import json
from pathlib import Path
import sys
import threading
import time
from typing import Any
import xml.etree.ElementTree as ET

from action_msgs.msg import GoalStatus
from control_msgs.action import FollowJointTrajectory
import mujoco
import numpy as np
import rclpy
from rclpy.action import ActionServer, CancelResponse
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.executors import ExternalShutdownException, MultiThreadedExecutor
from rclpy.node import Node
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from lip_id_ros.arrays import Array
from lip_id_ros.description.limits import joint_ranges
from lip_id_ros.nodes import messages, qos

ACTION = '/arm/follow_joint_trajectory'
STEP_S, STEPS_PER_STATE = 0.001, 2
"""The controller runs at 1 kHz, joint states come at 500 Hz."""

RADIUS_M = 0.04
STIFFNESS, RAMP_S = 40.0**2, 0.2
"""Of the controller [1/s^2], and the time in which it stops a motion that is cancelled."""

FRICTION, NOISE, SIGN_WIDTH = 0.03, 0.004, 0.05
"""Coulomb friction, viscous friction at full speed and noise, in the largest torque; and the
velocity at which the controller's own friction is tanh(1) [rad/s]."""

ROTOR, LEAST_ROTOR = 0.3, 0.01
"""Inertia of rotors in what the joint moves, and at least in the largest of these."""

COUNTS = 2.0 * np.pi / 2**18
"""Resolution of positions [rad]."""


@dataclass(frozen=True)
class Cell:
    """An arm and what stands around it; lengths in m, angles in rad."""

    urdf: str
    joints: tuple[str, ...]
    posture: tuple[float, ...]
    floor: float
    wall: float


def description(path: Path, joints: tuple[str, ...]) -> str:
    """Return the URDF without shapes, its other joints fixed."""
    robot = ET.fromstring(path.read_text(encoding='utf-8'))
    for link in robot.findall('link'):
        for shape in (*link.findall('visual'), *link.findall('collision')):
            link.remove(shape)
    for each in (*robot.findall('transmission'), *robot.findall('gazebo')):
        robot.remove(each)
    for joint in robot.findall('joint'):
        if joint.get('name') not in joints:
            joint.set('type', 'fixed')
    return ET.tostring(robot, encoding='unicode')


class Arm:
    """The arm in its cell, and the controller that moves it."""

    def __init__(self, cell: Cell, text: str, has_surroundings: bool = True) -> None:
        self._model = model = _compiled(cell, text)
        if not has_surroundings:
            model.geom_conaffinity[:] = 0
        self._data = mujoco.MjData(model)
        n = model.nq
        ranges = joint_ranges(text, cell.urdf, cell.joints)
        self.effort, self.velocity = np.array(ranges.effort), np.array(ranges.velocity)
        self._data.qpos[:] = cell.posture
        mujoco.mj_forward(model, self._data)
        inertia = np.diag(self._inertia())
        model.dof_armature[:] = np.maximum(ROTOR * inertia, LEAST_ROTOR * inertia.max())
        self._coulomb, self._viscous = (
            FRICTION * self.effort,
            FRICTION * self.effort / self.velocity,
        )
        model.dof_frictionloss[:], model.dof_damping[:] = self._coulomb, self._viscous
        self._plan: tuple[Array, Array] | None = None
        self._reference = np.array([cell.posture, np.zeros(n), np.zeros(n)])
        self._stopped_at: tuple[float, Array] | None = None
        self._begun = 0.0
        self.contacts = 0

    @property
    def t(self) -> float:
        """Time since the start [s]."""
        return float(self._data.time)

    @property
    def state(self) -> tuple[Array, Array, Array, Array]:
        """Return q, dq, ddq and the torque of the drives, each (n,)."""
        data = self._data
        return data.qpos.copy(), data.qvel.copy(), data.qacc.copy(), data.qfrc_applied.copy()

    def begin(self, t: Array, rows: Array) -> None:
        """Follow states (N, 3, n) at times (N,) from now on."""
        self._plan, self._begun, self._stopped_at = (t, rows.reshape(len(t), -1)), self.t, None

    def stop(self) -> None:
        """Come to rest in `RAMP_S`."""
        self._plan, self._stopped_at = None, (self.t, self._reference.copy())

    def block(self, joint: int) -> None:
        """Have a joint stay where it is."""
        here = self._data.qpos[joint] - self._model.qpos0[joint]
        self._model.eq_data[joint, 0] = here
        self._data.eq_active[joint] = 1

    @property
    def is_done(self) -> bool:
        """Whether the plan is at its end."""
        return self._plan is not None and self.t - self._begun > self._plan[0][-1]

    def step(self) -> None:
        """Go on by a millisecond."""
        data = self._data
        self._reference = self._wanted()
        q, dq, ddq = self._reference
        away, slower = q - data.qpos, dq - data.qvel
        wanted = ddq + STIFFNESS * away + 2.0 * np.sqrt(STIFFNESS) * slower
        friction = self._coulomb * np.tanh(dq / SIGN_WIDTH) + self._viscous * dq
        torque = self._inertia() @ wanted + data.qfrc_bias + friction
        data.qfrc_applied[:] = np.clip(torque, -self.effort, self.effort)
        mujoco.mj_step(self._model, data)
        self.contacts += data.ncon

    def _wanted(self) -> Array:
        if self._plan is not None:
            times, rows = self._plan
            since = np.clip(self.t - self._begun, 0.0, times[-1])
            k = min(int(np.searchsorted(times, since, side='right')), len(times) - 1)
            share = (since - times[k - 1]) / (times[k] - times[k - 1])
            return np.asarray(((1 - share) * rows[k - 1] + share * rows[k]).reshape(3, -1))
        if self._stopped_at is not None:
            since = min(self.t - self._stopped_at[0], RAMP_S)
            q, dq, _ = self._stopped_at[1]
            slow = 1.0 - since / RAMP_S
            return np.array(
                [q + dq * since * (1.0 + slow) / 2.0, dq * slow, -dq * (slow > 0) / RAMP_S]
            )
        return self._reference

    def _inertia(self) -> Array:
        n = self._model.nv
        out = np.zeros((n, n))
        mujoco.mj_fullM(self._model, self._data, out)
        return out


def _compiled(cell: Cell, text: str) -> Any:
    """Put capsules between the joints, which touch floor and wall but not each other."""
    spec = mujoco.MjSpec.from_string(text)
    bodies = [_body_of(spec, name) for name in cell.joints]
    for body, after in zip(bodies, [*bodies[1:], None], strict=True):
        geom = body.add_geom(mass=0.0, contype=1, conaffinity=0, size=[RADIUS_M, 0, 0])
        end = [0.0] * 3 if after is None else list(after.pos)
        if np.linalg.norm(end) > 1e-6:
            geom.type, geom.fromto = mujoco.mjtGeom.mjGEOM_CAPSULE, [0.0, 0.0, 0.0, *end]
        else:
            geom.type = mujoco.mjtGeom.mjGEOM_SPHERE
    around = {'contype': 0, 'conaffinity': 1}
    spec.worldbody.add_geom(
        type=mujoco.mjtGeom.mjGEOM_PLANE, size=[9, 9, 1], pos=[0, 0, cell.floor], **around
    )
    spec.worldbody.add_geom(
        type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.05, 9, 9], pos=[cell.wall + 0.05, 0, 0], **around
    )
    for name in cell.joints:
        spec.add_equality(
            type=mujoco.mjtEq.mjEQ_JOINT, objtype=mujoco.mjtObj.mjOBJ_JOINT, name1=name,
            active=False, data=[0.0] * mujoco.mjNEQDATA, solref=[0.004, 1.0],
        )  # fmt: skip
    spec.option.timestep = STEP_S
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    return spec.compile()


def _body_of(spec: Any, joint: str) -> Any:
    return next(body for body in spec.bodies if any(each.name == joint for each in body.joints))


class ArmNode(Node):
    """The arm, in the time of the wall, or behind it where the machine is busy; /clock has it."""

    def __init__(self) -> None:
        super().__init__('mujoco_arm')
        values = json.loads(self.declare_parameter('cell', '').value)
        self._cell = cell = Cell(**values)
        text = description(Path(cell.urdf), tuple(cell.joints))
        self._arm, self._lock = Arm(cell, text), threading.Lock()
        self._block_at = self.declare_parameter('block_at_s', np.inf).value
        self._block = self.declare_parameter('block_joint', 0).value
        self._path = self.declare_parameter('outcome_path', '').value
        self._rng = np.random.default_rng(self.declare_parameter('seed', 0).value)
        self._noise = NOISE * self._arm.effort
        self._outcome: dict[str, Any] = {'motion_s': 0.0, 'blocked': None, 'cancelled': None}
        self._start_ns = self.get_clock().now().nanoseconds
        self._begun, self._steps = time.monotonic(), 0
        self._states = self.create_publisher(JointState, '/joint_states', qos.OUTPUT)
        self._arm_clock = self.create_publisher(Clock, '/clock', qos.OUTPUT)
        urdf = self.create_publisher(String, '/robot_description', qos.LATCHED)
        urdf.publish(String(data=text))
        self._server = ActionServer(
            self, FollowJointTrajectory, ACTION,
            execute_callback=self._execute, cancel_callback=self._cancel,
            callback_group=ReentrantCallbackGroup(),
        )  # fmt: skip
        threading.Thread(target=self._run, daemon=True).start()

    def _run(self) -> None:
        while True:
            while self._steps * STEP_S < time.monotonic() - self._begun:
                with self._lock:
                    self._arm.step()
                self._steps += 1
                if self._steps % STEPS_PER_STATE == 0:
                    self._publish()
            time.sleep(STEP_S)

    def _publish(self) -> None:
        q, dq, _, torque = self._arm.state
        stamp = messages.stamp_at(self._start_ns + round(1e9 * self._arm.t))
        noise = self._noise * self._rng.standard_normal(len(q))
        with suppress(Exception):  # the context may end while the thread runs
            self._arm_clock.publish(Clock(clock=stamp))
            self._states.publish(
                messages.joint_state_message(
                    stamp, self._cell.joints, np.round(q / COUNTS) * COUNTS, dq, torque + noise
                )
            )

    def _cancel(self, _: Any) -> CancelResponse:
        with self._lock:
            self._arm.stop()
            self._outcome['cancelled'] = self._arm.t
        return CancelResponse.ACCEPT

    def _execute(self, handle: Any) -> Any:
        plan = handle.request.trajectory
        order = [plan.joint_names.index(each) for each in self._cell.joints]
        t = np.array(
            [p.time_from_start.sec + 1e-9 * p.time_from_start.nanosec for p in plan.points]
        )
        rows = np.array([[p.positions, p.velocities, p.accelerations] for p in plan.points])
        with self._lock:
            self._arm.begin(t, rows[:, :, order])
            begun = self._arm.t
        result = FollowJointTrajectory.Result()
        while handle.status == GoalStatus.STATUS_EXECUTING and not self._arm.is_done:
            if self._outcome['blocked'] is None and self._arm.t - begun > self._block_at:
                with self._lock:
                    self._arm.block(self._block)
                    self._outcome['blocked'] = self._arm.t
            time.sleep(STEP_S)
        self._outcome['motion_s'] += self._arm.t - begun
        self._outcome['contacts'] = self._arm.contacts
        Path(self._path).write_text(json.dumps(self._outcome))
        if self._arm.is_done:
            handle.succeed()
        else:
            handle.canceled()
        return result


def as_parameter(cell: Cell) -> str:
    """Return the text that the node's parameter `cell` takes."""
    return json.dumps(asdict(cell))


def main() -> int:
    """Run the node until it is interrupted."""
    rclpy.init()
    executor = MultiThreadedExecutor(num_threads=3)
    executor.add_node(ArmNode())
    with suppress(KeyboardInterrupt, ExternalShutdownException):
        executor.spin()
    return 0


if __name__ == '__main__':
    sys.exit(main())
