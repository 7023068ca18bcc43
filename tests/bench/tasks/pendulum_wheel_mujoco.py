"""A rod on a wheel that rolls on a plane is kept up by a controller of its torque."""

import mujoco

XML = """
<mujoco>
  <option timestep="0.001"/>
  <worldbody>
    <geom type="plane" size="50 50 1"/>
    <body name="wheel" pos="0 0 0.1">
      <inertial pos="0 0 0" mass="1" diaginertia="0.003 0.005 0.003"/>
      <joint name="x" type="slide" axis="1 0 0"/>
      <joint name="z" type="slide" axis="0 0 1"/>
      <joint name="roll" axis="0 1 0"/>
      <geom type="sphere" size="0.1" friction="0.8"/>
    </body>
    <body name="rod" pos="0 0 0.5">
      <inertial pos="0 0 0" mass="0.5" diaginertia="0.02 0.02 0.001"/>
      <joint name="rx" type="slide" axis="1 0 0"/>
      <joint name="rz" type="slide" axis="0 0 1"/>
      <joint name="lean" axis="0 1 0"/>
      <geom type="capsule" size="0.01 0.3" contype="0" conaffinity="0"/>
    </body>
  </worldbody>
  <equality><connect body1="wheel" body2="rod" anchor="0 0 0"/></equality>
</mujoco>
"""

model = mujoco.MjModel.from_xml_string(XML)
data = mujoco.MjData(model)
lean, roll, x = (model.joint(name).qposadr[0] for name in ("lean", "roll", "x"))
steps = 0
while data.time < 10.0:
    if data.time < 0.05:
        torque = 0.4
    elif steps % 10 == 0:
        control = 0.5 * data.qpos[x] + 1.0 * data.qvel[x]
        torque = 20 * data.qpos[lean] + 4 * data.qvel[lean] + control
    data.qfrc_applied[roll], data.qfrc_applied[lean] = torque, -torque
    mujoco.mj_step(model, data)
    steps += 1
print(data.qpos[lean])
