"""Stop a robot whose driver keeps its last command: send zero when commands cease."""

from __future__ import annotations

import math
import time
from typing import Any

from geometry_msgs.msg import Twist, TwistStamped
from rclpy.node import Node

from . import ending, running

LASTS, PERIOD = 2.0, 0.05
"""How long zeros are sent, and the time between two of them, s."""


class Watchdog(Node):  # type: ignore[misc]
    """
    A node on the robot that sends zeros some time (`silent`) after the last command of motion.

    It is for the case that what sends the commands, such as a smoother, dies while the robot
    drives. Where commands of zero came anyway, its own change nothing. When it is told to
    end after a motion, it sends zeros, too: a launch file ends the smoother at the same time.
    """

    def __init__(self) -> None:
        super().__init__('watchdog')
        topic = self.declare_parameter('driver_topic', 'cmd_vel').value
        self._stamped = self.declare_parameter('stamped', False).value
        self._silent = self.declare_parameter('silent', 0.3).value
        kind = TwistStamped if self._stamped else Twist
        self._moved = -math.inf
        self._out = self.create_publisher(kind, topic, 1)
        self.create_subscription(kind, topic, self._on_command, 10)
        self.create_timer(PERIOD, self._tick)

    def _on_command(self, message: Any) -> None:
        twist = message.twist if self._stamped else message
        if twist.linear.x or twist.linear.y or twist.angular.z:
            self._moved = time.monotonic()

    def _tick(self) -> None:
        if 0.0 <= time.monotonic() - self._moved - self._silent < LASTS:
            self._stop()

    def send_last(self, _reason: str) -> None:
        """Send zeros for the last time, if there was a motion just now."""
        if time.monotonic() - self._moved < LASTS:
            ending.send_last(self._stop, None, LASTS)

    def _stop(self, _command: Any = None) -> None:
        """Send a command of zero."""
        message = TwistStamped() if self._stamped else Twist()
        if self._stamped:
            message.header.stamp = self.get_clock().now().to_msg()
        self._out.publish(message)


def main(args: Any = None) -> None:
    """Watch until the process is told to end; the last commands are zero."""
    running.run('watchdog', Watchdog, args)


if __name__ == '__main__':
    main()
