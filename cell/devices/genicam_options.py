"""What a cell file says of a GenICam camera, in the drivers' words."""

from __future__ import annotations

from cell.storage.files.camera_file import FeatureNamesFile, GenicamOptionsFile
from drivers.focus import FocusNames
from drivers.genicam_camera import GenICamOptions
from drivers.genicam_settings import FeatureNames


def genicam_options(camera: GenicamOptionsFile) -> GenICamOptions:
    """Options of the driver, names that the file does not give being those of the SFNC."""
    return GenICamOptions(
        pixel_format=camera.pixel_format,
        features=camera.features,
        software_trigger=camera.software_trigger,
        names=_feature_names(camera.feature_names),
        focus_names=_focus_names(camera.feature_names),
    )


def _feature_names(file: FeatureNamesFile) -> FeatureNames:
    standard = FeatureNames()
    return FeatureNames(
        exposure=(file.exposure,) if file.exposure else standard.exposure,
        exposure_unit_s=file.exposure_unit_s,
        gain=(file.gain,) if file.gain else standard.gain,
        gain_is_factor=file.gain_is_factor,
        temperature=file.temperature or standard.temperature,
    )


def _focus_names(file: FeatureNamesFile) -> FocusNames:
    standard = FocusNames()
    return FocusNames(
        selector=file.focus_selector or standard.selector,
        controller=file.focus_controller,
        position=file.focus_position or standard.position,
        auto=file.focus_auto or standard.auto,
        status=(file.focus_status,) if file.focus_status else standard.status,
    )
