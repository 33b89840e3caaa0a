"""A bridge between ROS 2 and a viewer's messages: poses in, joint states out.

This file has not been run: ROS 2 is not a package of the Python index and was not installed where it was written. What
it says to the viewer is what over_websocket.py says, which is run; what it says to ROS 2 is from rclpy's documentation.

    wbc view play --port 8080 --no-browser
    python examples/remote/ros2_bridge.py ws://127.0.0.1:8080/wbc
    ros2 topic pub /wbc/target geometry_msgs/msg/PoseStamped ...      # a target in the world frame [m]
    ros2 topic echo /joint_states
"""

import json
import sys
import threading

import rclpy
from geometry_msgs.msg import PoseStamped, TwistStamped
from rclpy.node import Node
from sensor_msgs.msg import JointState
from websockets.sync.client import connect


class Bridge(Node):
    """One WebSocket to the viewer; callbacks of ROS write to it, a thread reads from it."""

    def __init__(self, address: str) -> None:
        super().__init__("wbc_bridge")
        self.socket = connect(address, max_size=None)
        hello = json.loads(self.socket.recv())
        self.hand = next(item["name"] for item in hello["items"] if item["kind"] == "EndEffector")
        self.joints = [joint for joint in hello["joints"] if joint["place"] >= 0]
        self.numbers = [k for k, joint in enumerate(hello["joints"]) if joint["place"] >= 0]
        self.states = self.create_publisher(JointState, "/joint_states", 10)
        self.create_subscription(PoseStamped, "/wbc/target", self.target, 10)
        self.create_subscription(TwistStamped, "/wbc/rate", self.rate, 10)
        # A node that hangs stops the robot
        self.create_timer(0.1, lambda: self.send(type="alive"))
        self.send(type="operate")
        threading.Thread(target=self.read, daemon=True).start()

    def send(self, **message: object) -> None:
        self.socket.send(json.dumps({"wbc": 1, **message}))

    def target(self, message: PoseStamped) -> None:
        p, o = message.pose.position, message.pose.orientation
        self.send(type="set", item=self.hand, values={"target": [p.x, p.y, p.z, o.x, o.y, o.z, o.w]})

    def rate(self, message: TwistStamped) -> None:
        v, w = message.twist.linear, message.twist.angular
        self.send(type="rate", item=self.hand, rate=[v.x, v.y, v.z, w.x, w.y, w.z])

    def read(self) -> None:
        for text in self.socket:
            message = json.loads(text)
            if message["type"] == "refused":
                self.get_logger().warning(message["reason"])
            elif message["type"] == "state":
                out = JointState()
                out.header.stamp = self.get_clock().now().to_msg()
                out.name = [joint["name"] for joint in self.joints]
                out.position = [message["q"][joint["place"]] for joint in self.joints]
                out.velocity = [message["v"][k] for k in self.numbers]
                self.states.publish(out)


rclpy.init()
bridge = Bridge(sys.argv[1] if len(sys.argv) > 1 else "ws://127.0.0.1:8080/wbc")
rclpy.spin(bridge)
