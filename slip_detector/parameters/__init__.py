"""Parameters as fields of frozen dataclasses: what all sets share, and one file for each set."""

from slip_detector.parameters.detector import ChainConfig, DetectorConfig
from slip_detector.parameters.driver import DriverConfig
from slip_detector.parameters.evaluation import EvaluationConfig
from slip_detector.parameters.grasp import GraspConfig
from slip_detector.parameters.recording import RecordingConfig
from slip_detector.parameters.tuning import TuneConfig

__all__ = [
    'ChainConfig',
    'DetectorConfig',
    'DriverConfig',
    'EvaluationConfig',
    'GraspConfig',
    'RecordingConfig',
    'TuneConfig',
]
