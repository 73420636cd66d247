"""Each test has a ROS domain in which nothing but itself is heard."""

import pytest
from domains import DOMAINS, is_inhabited, reserved_domain

rclpy = pytest.importorskip("rclpy")


def test_a_domain_in_which_a_node_is_left_is_not_given_to_a_test() -> None:
    context = rclpy.Context()
    with reserved_domain() as domain:
        assert not is_inhabited(domain)
        rclpy.init(context=context, domain_id=domain)
        node = rclpy.create_node("left_behind", context=context)
    try:
        assert is_inhabited(domain)
        assert domain not in {_reserved() for _ in DOMAINS}
    finally:
        node.destroy_node()
        context.shutdown()


def _reserved() -> int:
    with reserved_domain() as domain:
        return domain
