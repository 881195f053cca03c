# The simulator in a container: see docs/container.md. The first stage builds; the second one has only what runs.
ARG ROS_DISTRO=jazzy

FROM ros:${ROS_DISTRO}-ros-base AS build
SHELL ["/bin/bash", "-e", "-c"]
RUN apt-get update \
 && apt-get install --yes --no-install-recommends python3-scipy python3-venv \
 && rm -rf /var/lib/apt/lists/*
# Numba is not a package of Ubuntu 24.04. NumPy stays that of the system, against which the messages are compiled.
COPY requirements/python.txt /tmp/
RUN python3 -m venv --system-site-packages /opt/manta/venv \
 && python3 -c 'import numpy; print(f"numpy=={numpy.__version__}")' > /tmp/constraints.txt \
 && /opt/manta/venv/bin/pip install --no-cache-dir --constraint /tmp/constraints.txt "$(grep '^numba==' /tmp/python.txt)"
COPY package.xml setup.py setup.cfg LICENSE /tmp/manta_sim_ros/
COPY config /tmp/manta_sim_ros/config
COPY launch /tmp/manta_sim_ros/launch
COPY manta_sim_ros /tmp/manta_sim_ros/manta_sim_ros
COPY resource /tmp/manta_sim_ros/resource
COPY rviz /tmp/manta_sim_ros/rviz
COPY urdf /tmp/manta_sim_ros/urdf
RUN source "/opt/ros/$ROS_DISTRO/setup.bash" \
 && cd /tmp \
 && /opt/manta/venv/bin/python -m colcon build --paths manta_sim_ros --merge-install --install-base /opt/manta/install
# Of both couplings, for the processor of this machine, and for any processor (`-e NUMBA_CPU_NAME=generic`).
ENV NUMBA_CACHE_DIR=/opt/manta/kernels
RUN source /opt/manta/install/setup.bash \
 && for cpu in '' generic; do \
      for config in /opt/manta/install/share/manta_sim_ros/config/*.yaml; do \
        env ${cpu:+NUMBA_CPU_NAME=$cpu} /opt/manta/venv/bin/python -c "import sys; \
from manta_sim_ros.dynamics import Parameters, compile_kernels; \
compile_kernels(Parameters.from_yaml(sys.argv[1]), print)" "$config"; \
      done; \
    done

FROM ros:${ROS_DISTRO}-ros-core
RUN apt-get update \
 && apt-get install --yes --no-install-recommends python3-scipy "ros-$ROS_DISTRO-tf2-msgs" \
 && rm -rf /var/lib/apt/lists/*
COPY --from=build /opt/manta /opt/manta
# Nobody but root can write to /opt/manta. Shared memory does not leave the container, so that UDP is used.
ENV NUMBA_CACHE_DIR=/opt/manta/kernels \
    ROS_LOG_DIR=/tmp/ros_log \
    FASTDDS_BUILTIN_TRANSPORTS=UDPv4
USER 10001:10001
WORKDIR /tmp
ENTRYPOINT ["/bin/bash", "-c", "source /opt/manta/install/setup.bash && exec \"$@\"", "manta"]
CMD ["/opt/manta/install/lib/manta_sim_ros/sim_node"]
