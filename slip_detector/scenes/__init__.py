"""The simulated fingertip: one file for each part; a scene file puts them together."""

from slip_detector.scenes.scene import Scene, SceneSamples
from slip_detector.scenes.scene_files import find_scene, load_scene

__all__ = ['Scene', 'SceneSamples', 'find_scene', 'load_scene']
