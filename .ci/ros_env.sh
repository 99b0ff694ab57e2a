#!/usr/bin/env bash
# Real ROS for tests/realros: ROS 1's rosbag for Debian's Python, and ROS 2's rclpy in .venv-ros2.
# What cannot be installed here is said and left out; its tests are then skipped.
set -uo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

ros1_works() {
    /usr/bin/python3 -c "import rosbag, sensor_msgs.msg, nav_msgs.msg, tf2_msgs.msg" 2>/dev/null
}
ros1_install() {
    command -v apt-get >/dev/null && [[ "$(id -u)" == 0 ]] || return 1
    local packages=(python3-rosbag python3-sensor-msgs python3-nav-msgs python3-tf2-msgs)
    export DEBIAN_FRONTEND=noninteractive
    # The lists of packages may be there and fresh; fetching them anew costs time.
    timeout 150 apt-get install -qq -y --no-install-recommends "${packages[@]}" &>/dev/null ||
        { timeout 60 apt-get update -qq && timeout 150 apt-get install -qq -y \
            --no-install-recommends "${packages[@]}"; } &>/dev/null
}

ros2_works() {
    .venv-ros2/bin/python -c \
        "import rclpy.serialization, sensor_msgs.msg, nav_msgs.msg, mcap" 2>/dev/null
}
ros2_install() {
    # The wheels of one ROS must not be mixed with those of another: versions are fixed.
    python3 -m venv --clear .venv-ros2 && echo "*" >.venv-ros2/.gitignore && timeout 150 .venv-ros2/bin/pip install -q \
        "ros-kilted-rclpy[fastrtps]==9.1.2" "ros-sensor-msgs==5.5.1" "ros-nav-msgs==5.5.1" \
        "mcap>=1.2" lz4 zstandard
}

ros1_works || { ros1_install && ros1_works; } ||
    echo ".ci/ros_env.sh: no ROS 1 (Debian's python3-rosbag) here; its tests are skipped" >&2
ros2_works || { ros2_install && ros2_works; } ||
    echo ".ci/ros_env.sh: no ROS 2 (wheels of rclpy) here; its tests are skipped" >&2
exit 0
