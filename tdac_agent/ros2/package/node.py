"""Drive over ROS 2 with the exported controller: topics, tf and signals for `core`."""

from __future__ import annotations

import json
import math
from pathlib import Path
import time
from typing import Any

from ament_index_python.packages import get_package_share_directory
from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped, Twist, TwistStamped
from nav_msgs.msg import OccupancyGrid, Odometry, Path as PathMessage
from rcl_interfaces.msg import ParameterDescriptor, ParameterType
from rcl_interfaces.srv import GetParameters
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, qos_profile_sensor_data, QoSProfile
from rclpy.time import Time
from sensor_msgs.msg import LaserScan
from std_msgs.msg import Header, String
from std_srvs.srv import Trigger
from tf2_ros import Buffer, TransformException, TransformListener

from . import core, ending, motion, running, scans, worker

PACKAGE = __package__ or ''
PATH_STEP, MOST_POSES = 0.05, 5000
"""Distance of two poses of the published path, m; the most of them."""
ASKED, ANSWERED = 2.0, 1.0
"""Time between two questions to `dead_man_node`, and the longest for an answer, s."""
ONLOOKERS, WATCHDOG = ('rosbag2', '_ros2cli'), 'watchdog'
"""How names of nodes begin that only record or show commands; one that sends zeros alone."""
DEFAULTS: dict[str, Any] = {
    'scan_topic': 'scan',
    'odom_topic': 'odom',
    'covariance_topic': 'amcl_pose',
    'map_topic': 'map',
    'command_topic': 'cmd_vel_tdac',
    'driver_topic': 'cmd_vel',
    'stamped': False,
    'pose_source': 'tf',
    'map_frame': 'map',
    'base_frame': 'base_link',
    'odom_frame': 'odom',
    'max_localiser_age': 1.0,
    'origin': [0.0, 0.0, 0.0],
    'dead_man': 0.0,
    'dead_man_node': 'velocity_smoother',
    'dead_man_parameter': 'velocity_timeout',
    'max_age': 0.0,
    'max_jump': 0.0,
    'max_deviation': 0.0,
    'max_speed': 0.0,
    'resample_scan': False,
    'start_on': 'service',
    'any_start': False,
    'any_map': False,
}


class DriveNode(Node):  # type: ignore[misc]
    """A node that publishes commands at the control rate."""

    def __init__(self) -> None:
        super().__init__('drive')
        own = {  # read-only, since a later value would change nothing
            name: self.declare_parameter(name, value, ParameterDescriptor(read_only=True)).value
            for name, value in DEFAULTS.items()}
        self.own = own
        motion.check_pose_parameters(own['pose_source'], own['origin'])
        folder = Path(get_package_share_directory(PACKAGE)) / 'controller'
        worker.check_files(folder)
        text = (folder / 'settings.json').read_text(encoding='utf-8')  # raw read: installed
        written = json.loads(text)
        settings = core.Settings(
            dt=written['dt'], horizon=written['horizon'], start=tuple(written['start']),
            goal=tuple(written['goal']), goal_tolerance=written['goal_tolerance'],
            robot=written['robot'], dead_man=own['dead_man'], max_age=own['max_age'],
            max_jump=own['max_jump'], max_deviation=own['max_deviation'],
            max_localiser_age=own['max_localiser_age'], max_speed=own['max_speed'],
            resample_scan=own['resample_scan'], any_start=own['any_start'],
            start_on=own['start_on'], any_map=own['any_map'], own_map=written['map'])
        self.core = core.Core(settings, worker.Worker(folder, written['controller_sha256']))
        self._wait = core.SHARE * settings.dt
        self._mounts: dict[str, float] = {}
        self._said = ''
        self._buffer = Buffer()
        self._listener = TransformListener(self._buffer, self)
        kind = TwistStamped if own['stamped'] else Twist
        self._out = self.create_publisher(kind, own['command_topic'], 1)
        self._driver = self.resolve_topic_name(own['driver_topic'])
        kept = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._state = self.create_publisher(String, '~/state', kept)
        self._way, self._driven = PathMessage(), self.create_publisher(PathMessage, '~/path', kept)
        self._show_goal(self.create_publisher(PoseStamped, '~/goal', kept), settings.goal)
        self.create_subscription(
            LaserScan, own['scan_topic'], self._on_scan, qos_profile_sensor_data)
        if own['pose_source'] == 'odom':
            self.create_subscription(
                Odometry, own['odom_topic'], self._on_odom, qos_profile_sensor_data)
        elif own['covariance_topic']:
            self.create_subscription(
                PoseWithCovarianceStamped, own['covariance_topic'], self._on_localised, kept)
        if not own['any_map']:
            self.create_subscription(OccupancyGrid, own['map_topic'], self._on_map, kept)
        ways = [f'{why}: {way:.3f}' for why, way in settings.stops_within().items()]
        self.get_logger().info(f'stops within (m): {"; ".join(ways)}')
        self.publish(core.Command(0.0, 0.0, 'waiting'))
        self._future, self._asked = None, -math.inf
        self._timer_unfit = 'no answer of dead_man_node yet'
        self._client = self._ask_dead_man()
        self.create_service(Trigger, '~/start', self._on_start)
        self.create_service(Trigger, '~/stop', self._on_stop)
        self.create_timer(settings.dt, self._tick)

    def _ask_dead_man(self) -> Any:
        """
        Return a client for the timer's parameter, where a node has one.

        It is asked again and again: a node that does not answer is dead, or frozen.
        """
        if not self.own['dead_man_node']:
            return None
        client = self.create_client(
            GetParameters, f'{self.own["dead_man_node"]}/get_parameters')
        if not client.wait_for_service(timeout_sec=5.0):
            raise core.SettingsError(f'dead_man_node: no node {self.own["dead_man_node"]}')
        return client

    def _check_dead_man(self) -> str:
        """Return why the timer is not known to be as declared, or an empty text."""
        if self._client is None:
            return ''
        name, now, future = self.own['dead_man_node'], time.monotonic(), self._future
        if future is None and now >= self._asked + ASKED:
            request = GetParameters.Request(names=[self.own['dead_man_parameter']])
            self._future, self._asked = self._client.call_async(request), now
        elif future is not None and future.done():
            self._future, self._timer_unfit = None, ''
            response = future.result()
            values = [
                each.double_value if each.type == ParameterType.PARAMETER_DOUBLE else None
                for each in (response.values if response is not None else ())]
            self.core.check_timer(f'{self.own["dead_man_parameter"]} of {name}', values)
        elif future is not None and now > self._asked + ANSWERED:
            self._client.remove_pending_request(future)
            self._future = None
            self._timer_unfit = f'no answer of {name} (dead_man_node): is it dead?'
        return self._timer_unfit

    def _on_start(self, _request: Any, response: Any) -> Any:
        now = self.get_clock().now().nanoseconds * 1e-9
        if now:
            response.success, response.message = self.core.start(now)
        else:
            response.success, response.message = False, 'no time on /clock yet (use_sim_time)'
        return response

    def _on_stop(self, _request: Any, response: Any) -> Any:
        response.success, response.message = True, self.core.stop()
        self._tick()  # the zero does not wait for the next period
        return response

    def _on_scan(self, message: LaserScan) -> None:
        mount = self._mount(message.header.frame_id)
        if mount is not None:
            try:
                age = scans.oldest_ray(
                    len(message.ranges), message.scan_time, message.time_increment)
            except scans.LayoutError as error:
                self.core.refuse_scan(str(error))
                return
            layout = scans.Layout(
                len(message.ranges), message.angle_min, message.angle_increment,
                message.range_min, message.range_max, mount)
            self.core.scan(_seconds(message.header.stamp), layout, message.ranges, age)

    def _mount(self, frame: str) -> float | None:
        """Return the yaw of the scanner on the robot; None while tf does not know it."""
        if frame not in self._mounts:
            base = self.own['base_frame']
            try:
                found = self._buffer.lookup_transform(base, frame, Time())
            except TransformException:
                self.core.refuse_scan(f'tf does not know where {frame} is on {base}')
                return None
            place, turn = found.transform.translation, found.transform.rotation
            try:
                self._mounts[frame] = scans.mounted(
                    self.core.settings.robot, (place.x, place.y),
                    (turn.x, turn.y, turn.z, turn.w))
            except scans.LayoutError as error:
                self.core.end(str(error))
                return None
        return self._mounts[frame]

    def _on_odom(self, message: Odometry) -> None:
        place, turn = message.pose.pose.position, message.pose.pose.orientation
        own = (place.x, place.y, motion.yaw_of(turn.x, turn.y, turn.z, turn.w))
        pose = motion.compose(tuple(self.own['origin']), own)
        self._on_localised(message)
        self.core.pose(_seconds(message.header.stamp), *pose)
        self._show(message.header.stamp, pose)

    def _on_map(self, message: OccupancyGrid) -> None:
        own = message.info
        place, turn = own.origin.position, own.origin.orientation
        yaw = motion.yaw_of(turn.x, turn.y, turn.z, turn.w)
        self.core.localiser_map((own.width, own.height), own.resolution, (place.x, place.y, yaw))

    def _on_localised(self, message: Any) -> None:
        own = message.pose.covariance
        self.core.where.take_variances((float(own[0]), float(own[7]), float(own[35])))

    def _look_up(self) -> None:
        try:
            found = self._buffer.lookup_transform(
                self.own['map_frame'], self.own['base_frame'], Time())
        except TransformException:
            return
        place, turn = found.transform.translation, found.transform.rotation
        yaw = motion.yaw_of(turn.x, turn.y, turn.z, turn.w)
        self.core.pose(_seconds(found.header.stamp), place.x, place.y, yaw)
        self._show(found.header.stamp, (place.x, place.y, yaw))
        try:
            found = self._buffer.lookup_transform(
                self.own['map_frame'], self.own['odom_frame'], Time())
        except TransformException:
            return
        if (stamp := _seconds(found.header.stamp)) > 0.0:  # 0: a static one
            self.core.where.take_transform(stamp)

    def _show_goal(self, out: Any, goal: tuple[float, float]) -> None:
        """Publish the goal once, for RViz."""
        self._way.header.frame_id = self.own['map_frame']
        message = PoseStamped(header=self._way.header)
        message.pose.position.x, message.pose.position.y = goal
        out.publish(message)
        self._goal = out

    def _show(self, stamp: Any, pose: tuple[float, float, float]) -> None:
        """Publish the driven path, for RViz, if the robot went on by a little."""
        last = self._way.poses[-1].pose.position if self._way.poses else None
        if last is not None and math.dist((last.x, last.y), pose[:2]) < PATH_STEP:
            return
        if not all(map(math.isfinite, pose)) or len(self._way.poses) >= MOST_POSES:
            return
        message = PoseStamped(header=Header(stamp=stamp, frame_id=self.own['map_frame']))
        message.pose.position.x, message.pose.position.y = pose[:2]
        message.pose.orientation.z = math.sin(0.5 * pose[2])
        message.pose.orientation.w = math.cos(0.5 * pose[2])
        self._way.poses.append(message)
        self._way.header.stamp = stamp
        self._driven.publish(self._way)

    def _tick(self) -> None:
        self.core.timer_unfit = self._check_dead_man()
        if self.own['pose_source'] == 'tf':
            self._look_up()
        self._count()
        now = self.get_clock().now().nanoseconds * 1e-9
        self.publish(self.core.tick(now, self._wait))

    def _count(self) -> None:
        """Count who publishes the commands and who takes them, up to the robot's driver."""
        topic = self._out.topic_name  # remapped: these functions do not remap
        publishers, listeners = self._senders(topic), self._takers(topic)
        if self._driver != topic:  # a smoother is between them
            smoothers = self._senders(self._driver)
            publishers += max(smoothers - 1, 0)
            listeners = min(listeners, smoothers, self._takers(self._driver))
        self.core.publishers, self.core.listeners = publishers, listeners

    def _senders(self, topic: str) -> int:
        """Return how many may move the robot, such as `ros2 topic pub` and a played bag."""
        found = self.get_publishers_info_by_topic(topic)
        return sum(each.node_name != WATCHDOG for each in found)

    def _takers(self, topic: str) -> int:
        found = self.get_subscriptions_info_by_topic(topic)
        return sum(not each.node_name.startswith((*ONLOOKERS, WATCHDOG)) for each in found)

    def publish(self, command: core.Command) -> None:
        """Publish a command, and say what changed."""
        message = TwistStamped() if self.own['stamped'] else Twist()
        twist = message.twist if self.own['stamped'] else message
        if self.own['stamped']:
            message.header.stamp = self.get_clock().now().to_msg()
            message.header.frame_id = self.own['base_frame']
        twist.linear.x, twist.angular.z = command.v, command.omega
        self._out.publish(message)
        text = f'{command.state}: {command.reason}'.rstrip(': ')
        if text != self._said:
            self._said = text
            self._state.publish(String(data=text))
            self.get_logger().info(text)

    def send_last(self, reason: str) -> None:
        """End the drive, and send its last command."""
        lasts = core.PERIODS * self.core.settings.dt
        ending.send_last(self.publish, self.core.end(reason), lasts)


def _seconds(stamp: Any) -> float:
    return float(stamp.sec) + 1e-9 * float(stamp.nanosec)


def main(args: Any = None) -> None:
    """Drive until the process is told to end; the last command is zero."""
    running.run('drive', DriveNode, args)


if __name__ == '__main__':
    main()
