"""The machines that the page shows, with the numbers of their parameter files."""

from emir_analysis.robot_setup import path_parameters
from emir_analysis.view.arm import Outline
from emir_analysis.view.joint1 import Joint1
from emir_analysis.view.robot import WholeRobot
from emir_plant.robot.sheet import robot
from emir_plant.sheet import joint1


def subject_of_joint1() -> Joint1:
    """Return EMIR's joint 1."""
    g = joint1().geometry
    return Joint1(Outline(g.boom_length, g.triangle_a, g.triangle_b, g.triangle_gamma0))


def robot_subject() -> WholeRobot:
    """Return EMIR's whole robot."""
    return WholeRobot(path_parameters(robot()).arm)
