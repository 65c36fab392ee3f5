"""The simulated fingertip: a module for each part; a scene file says which parts there are."""

from slip_detector.scenes.scene import Scene, SceneSamples
from slip_detector.scenes.scene_files import find_scene, load_scene

__all__ = ['Scene', 'SceneSamples', 'find_scene', 'load_scene']
