"""A robot whose simulated time a test controls with the services of the node: pause, step and reset."""

import re

from geometry_msgs.msg import PoseStamped, WrenchStamped
from nav_msgs.msg import Odometry
from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import SetBool, Trigger

from manta_sim_ros.nodes.outputs import LATECOMER_DELAY


class LockstepRobot:
    """A simulator in its own namespace, whose simulated time this process controls."""

    def __init__(self, launch, probe, name, ros_arguments='', clock=None):
        self.probe, self.name = probe, name
        clock = clock or f'/{name}/clock'
        self.node = launch('sim_node', f'{ros_arguments} -r __ns:=/{name} -r /clock:={clock}')
        self.odometry = probe.record(Odometry, f'/{name}/odom')
        self.wrench = probe.record(WrenchStamped, f'/{name}/fin_wrench')
        self.clock = probe.record(Clock, clock)
        self.commands = probe.node.create_publisher(Float64MultiArray, f'/{name}/fin_command', 10)
        self.poses = probe.node.create_publisher(PoseStamped, f'/{name}/set_pose', 10)
        probe.until(lambda: self.commands.get_subscription_count() and self.poses.get_subscription_count(), name)

        self._clients = {
            service: probe.node.create_client(kind, f'/{name}/manta_sim/{service}') for service, kind in (
                ('pause', SetBool), ('step', Trigger), ('reset', Trigger), ('set_parameters', SetParameters))}
        paused = 'start_paused' in ros_arguments
        for service, client in self._clients.items():  # from now on, one call of each gets one answer
            probe.first_answer(client, client.srv_type.Request(**({'data': paused} if service == 'pause' else {})))

    def ask(self, service, **request):
        client = self._clients[service]
        return client.call_async(client.srv_type.Request(**request))

    def call(self, service, **request):
        future = self.ask(service, **request)
        self.probe.until(future.done, f'the answer of {service}')
        return future.result()

    def pause(self, data=True):
        return self.call('pause', data=data)

    def trigger(self, service):
        return self.call(service)

    def set_parameter(self, name, value):
        (result,) = self.call('set_parameters', parameters=[
            Parameter(name, value=value).to_parameter_msg()]).results
        return result

    def now(self):
        """Pause, and return the simulated time of that [ns], when the clock has said it too."""
        return self._time_of(self.pause())

    def step(self):
        """Step, and wait until the clock of its end was received, and the outputs that came before it."""
        end = self._time_of(self.trigger('step'))
        self.probe.until(lambda: self.odometry.stamps[-1:] == [end] == self.wrench.stamps[-1:], 'the outputs')
        return end

    def wait_for_repeats(self):
        """Wait until the paused robot has sent its last outputs again to those who have subscribed lately."""
        self.probe.listen(2.0 * LATECOMER_DELAY)

    def _time_of(self, answer):
        """Return the time in an answer [ns]. The clock may come later: a message may be lost, and be sent again."""
        assert answer.success, answer.message
        time = round(float(re.search(r'(\S+) s of simulated time', answer.message)[1]) * 1e9)
        self.probe.until(lambda: self.clock.stamps[-1:] == [time], f'the clock at {time}')
        return time

    def command(self, values):
        """Command the robot, and wait until the command was taken: the node warns of an empty one behind it."""
        refusals = self.node.output.count('refused so far')
        self.commands.publish(Float64MultiArray(data=values))
        self.probe.until(
            lambda: self.node.output.count('refused so far') > refusals, 'the command',
            doing=lambda: self.commands.publish(Float64MultiArray(data=[])), every=0.3)


def numbers(odometry, wrench):
    """Return the numbers of the motion of the robot in its messages, for a comparison bit by bit."""
    twist, force, torque = odometry.twist.twist, wrench.wrench.force, wrench.wrench.torque
    return [part for vector in (twist.linear, twist.angular, force, torque) for part in (vector.x, vector.y, vector.z)]
