"""Look at contact forces: a cube is pushed over a plane; forces over time, and a picture."""

import matplotlib
import mujoco
import numpy as np

matplotlib.use("agg")
import matplotlib.pyplot as plt

XML = """
<mujoco>
  <option timestep="0.001" cone="elliptic" impratio="10"/>
  <worldbody>
    <geom type="plane" size="50 50 1" friction="0.3"/>
    <body pos="0 0 0.05"><freejoint/>
      <geom type="box" size="0.05 0.05 0.05" density="1000" friction="0.3"/>
    </body>
  </worldbody>
</mujoco>
"""

model = mujoco.MjModel.from_xml_string(XML)
data = mujoco.MjData(model)
data.qvel[0] = 1.0
times, forces, one = [], [], np.zeros(6)
while data.time < 0.5:
    mujoco.mj_step(model, data)
    total = np.zeros(3)
    for k in range(data.ncon):
        mujoco.mj_contactForce(model, data, k, one)
        total += data.contact[k].frame.reshape(3, 3).T @ one[:3]
    times.append(data.time)
    forces.append(total)
print(forces[100])
figure, axes = plt.subplots()
axes.plot(times, forces)
axes.set_xlabel("time [s]")
figure.savefig("forces.png")
