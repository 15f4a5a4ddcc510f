"""A model as MuJoCo's own renderer shows it, drawn off screen in a process of its own.

Where no OpenGL is, that process fails, or is ended by it: whoever asked goes on and hears of nothing. This file is what
it runs; it needs NumPy and MuJoCo alone.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

WAYS = ("egl", "osmesa") if sys.platform == "linux" else ("",)
"""Of MUJOCO_GL, to be tried in this order where the user has not set it."""
SECONDS = 60
FINE = 2  # pixels a side for one of the picture: the edges of shapes are smooth


def rendered(model: Any, qpos: Any, camera: Any, rods: Any, size: tuple[int, int]) -> Any:
    """(height, width, 3) of bytes, white where nothing is; None where nothing can draw it.

    model: as it is to be coloured, which changes it; its `fovy` is the visible height [m]; camera: lookat (3,)
    [m], distance [m], azimuth and elevation [degrees]; rods: (K, 10) from (3,) to (3,) [m], radius [m], colour (3,);
    size: width and height.
    """
    import mujoco

    model.vis.global_.offwidth, model.vis.global_.offheight = (FINE * side for side in size)
    model.vis.quality.offsamples = 0
    with TemporaryDirectory() as folder:
        mujoco.mj_saveModel(model, str(Path(folder, "model.mjb")))
        np.savez(Path(folder, "asked.npz"), qpos=qpos, camera=camera, rods=rods, size=size)
        for way in [os.environ["MUJOCO_GL"]] if "MUJOCO_GL" in os.environ else WAYS:
            command, quiet = [sys.executable, "-P", __file__, folder], subprocess.DEVNULL
            try:
                done = subprocess.run(
                    command, env=os.environ | {"MUJOCO_GL": way}, stdout=quiet, stderr=quiet, timeout=SECONDS
                )
            except (OSError, subprocess.TimeoutExpired):
                continue
            if done.returncode == 0:
                return np.load(Path(folder, "drawn.npy"))
    return None


def _draw(folder: Path) -> None:
    import mujoco

    model, asked = mujoco.MjModel.from_binary_path(str(folder / "model.mjb")), np.load(folder / "asked.npz")
    data, camera, option = mujoco.MjData(model), mujoco.MjvCamera(), mujoco.MjvOption()
    data.qpos[:] = asked["qpos"]
    mujoco.mj_forward(model, data)
    camera.lookat[:] = asked["camera"][:3]
    camera.distance, camera.azimuth, camera.elevation = asked["camera"][3:]
    camera.orthographic = 1
    option.geomgroup[:], option.sitegroup[:], option.tendongroup[:], option.actuatorgroup[:] = 1, 0, 0, 0
    width, height = (FINE * asked["size"]).tolist()
    with mujoco.Renderer(model, height, width) as renderer:
        renderer.update_scene(data, camera, option)
        scene = renderer.scene
        for flag in (mujoco.mjtRndFlag.mjRND_SHADOW, mujoco.mjtRndFlag.mjRND_REFLECTION):
            scene.flags[flag] = 0
        for rod in asked["rods"]:
            geom = scene.geoms[scene.ngeom]
            kind, colour = mujoco.mjtGeom.mjGEOM_CAPSULE, np.append(rod[7:], 1.0).astype(np.float32)
            mujoco.mjv_initGeom(geom, kind, np.zeros(3), np.zeros(3), np.zeros(9), colour)
            mujoco.mjv_connector(geom, kind, rod[6], rod[:3], rod[3:6])
            geom.segid, geom.objid, geom.objtype = scene.ngeom, 0, mujoco.mjtObj.mjOBJ_GEOM
            scene.ngeom += 1
        pixels = renderer.render().astype(float)
        renderer.enable_segmentation_rendering()
        pixels[renderer.render()[..., 0] < 0] = 255.0
    fine = pixels.reshape(height // FINE, FINE, width // FINE, FINE, 3)
    np.save(folder / "drawn.npy", fine.mean(axis=(1, 3)).round().astype(np.uint8))


if __name__ == "__main__":
    _draw(Path(sys.argv[1]))
