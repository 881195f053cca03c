"""The compiled core: private to `manta_sim_ros.dynamics`. A change of a file here has the kernels compiled again."""
