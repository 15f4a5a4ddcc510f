"""The arm of the trials: four hinges, a position servo on each, written here."""

ARM = """<mujoco model="trial_arm">
  <compiler angle="radian"/>
  <option timestep="0.004" integrator="implicitfast"/>
  <default>
    <geom type="capsule" contype="0" conaffinity="0"/>
    <joint type="hinge" limited="true"/>
  </default>
  <worldbody>
    <body name="turret" pos="0 0 0.2">
      <joint name="yaw" axis="0 0 1" range="-2.8 2.8" damping="0.6" armature="0.08"/>
      <geom fromto="0 0 0 0 0 0.15" size="0.06" mass="3.5"/>
      <body name="upper" pos="0 0 0.15">
        <joint name="shoulder" axis="0 1 0" range="-2.2 2.2" damping="0.8" armature="0.1"/>
        <geom fromto="0 0 0 0.02 0 0.38" size="0.05" mass="3.2"/>
        <body name="fore" pos="0.02 0 0.38">
          <joint name="elbow" axis="0 1 0" range="-2.5 2.5" damping="0.4" armature="0.05"/>
          <geom fromto="0 0 0 0.3 0.02 0" size="0.04" mass="1.8"/>
          <body name="hand" pos="0.3 0.02 0">
            <joint name="wrist" axis="0 1 0" range="-2.5 2.5" damping="0.08" armature="0.01"/>
            <geom fromto="0 0 0 0.12 0 0.02" size="0.03" mass="0.6"/>
          </body>
        </body>
      </body>
    </body>
  </worldbody>
  <actuator>
    <position name="yaw_servo" joint="yaw" kp="220" kv="18" ctrlrange="-2.5 2.5"/>
    <position name="shoulder_servo" joint="shoulder" kp="380" kv="30" ctrlrange="-2 2"/>
    <position name="elbow_servo" joint="elbow" kp="180" kv="12" ctrlrange="-2.2 2.2"/>
    <position name="wrist_servo" joint="wrist" kp="25" kv="1.2" ctrlrange="-2.2 2.2"/>
  </actuator>
</mujoco>
"""
