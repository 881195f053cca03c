"""A robot whose time a test holds: paused, stepped and reset by the node's services."""

import re

from geometry_msgs.msg import PoseStamped, WrenchStamped
from nav_msgs.msg import Odometry
from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import SetBool, Trigger


class LockstepRobot:
    """A robot in a namespace of its own whose time this process holds."""

    def __init__(self, launch, probe, name, ros_arguments=''):
        self.probe, self.name = probe, name
        self.node = launch('sim_node', f'{ros_arguments} -r __ns:=/{name} -r /clock:=/{name}/clock')
        self.odometry = probe.record(Odometry, f'/{name}/odom')
        self.wrench = probe.record(WrenchStamped, f'/{name}/fin_wrench')
        self.clock = probe.record(Clock, f'/{name}/clock')
        self.commands = probe.node.create_publisher(Float64MultiArray, f'/{name}/fin_command', 10)
        self.poses = probe.node.create_publisher(PoseStamped, f'/{name}/set_pose', 10)
        probe.until(lambda: self.commands.get_subscription_count() and self.poses.get_subscription_count(), name)

        own = f'/{name}/manta_sim'
        self._clients = {
            what: probe.node.create_client(kind, f'{own}/{what}') for what, kind in (
                ('pause', SetBool), ('step', Trigger), ('reset', Trigger), ('set_parameters', SetParameters))}
        for what in ('pause', 'step', 'reset', 'set_parameters'):
            self._meet(what, data='start_paused' in ros_arguments)

    def _meet(self, what, data):
        """Call a service until it answers: middleware may lose the answer to a client that is new to the robot."""
        client = self._clients[what]
        self.probe.until(client.service_is_ready, what)
        request = SetBool.Request(data=data) if what == 'pause' else client.srv_type.Request()
        asked = []
        self.probe.until(
            lambda: any(future.done() for future in asked), f'the service {what}',
            doing=lambda: asked.append(client.call_async(request)), every=2.0)

    def ask(self, what, **request):
        client = self._clients[what]
        return client.call_async(client.srv_type.Request(**request))

    def call(self, what, **request):
        future = self.ask(what, **request)
        self.probe.until(future.done, f'answer of {what}')
        return future.result()

    def pause(self, data=True):
        return self.call('pause', data=data)

    def trigger(self, what):
        return self.call(what)

    def set_parameter(self, name, value):
        (result,) = self.call('set_parameters', parameters=[
            Parameter(name, value=value).to_parameter_msg()]).results
        return result

    def step(self):
        """Step, and wait until the clock of its end was heard and all that came before it."""
        before = len(self.clock)
        answer = self.trigger('step')
        assert answer.success, answer.message
        end = round(float(re.search(r'stepped to (\S+) s', answer.message)[1]) * 1e9)
        self.probe.until(lambda: len(self.clock) > before and self.clock.stamps[-1] == end, f'the clock at {end}')
        self.probe.until(lambda: self.odometry.stamps[-1:] == [end] == self.wrench.stamps[-1:], 'the outputs')
        return end

    def command(self, values):
        """Command it, and wait until it was taken: a refused one behind it is warned of."""
        refusals = self.node.output.count('refused so far')
        self.commands.publish(Float64MultiArray(data=values))
        self.probe.until(
            lambda: self.node.output.count('refused so far') > refusals, 'the command',
            doing=lambda: self.commands.publish(Float64MultiArray(data=[])), every=0.3)


def numbers(odometry, wrench):
    """Return what is heard of the robot's motion, bit for bit."""
    twist, force, torque = odometry.twist.twist, wrench.wrench.force, wrench.wrench.torque
    return [part for vector in (twist.linear, twist.angular, force, torque) for part in (vector.x, vector.y, vector.z)]
