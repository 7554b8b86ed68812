"""The published JSON schemas of the files, for editors and other programs.

``python -m cell.storage.files.schemas`` writes them anew; a test keeps them in step with the
models.
"""

from __future__ import annotations

import json
from pathlib import Path

from pydantic import BaseModel

from cell.storage.files.calibration_file import CalibrationFile
from cell.storage.files.cell_file import CellFile
from cell.storage.files.diagnosis_file import DiagnosisFile
from cell.storage.files.plan_file import PlanFile
from cell.storage.files.study_file import StudyFile
from cell.storage.files.verify_file import VerifyFile

FOLDER = Path(__file__).parents[1] / "schemas"
MODELS: dict[str, type[BaseModel]] = {
    "calibration.schema.json": CalibrationFile,
    "cell.schema.json": CellFile,
    "diagnosis.schema.json": DiagnosisFile,
    "plan.schema.json": PlanFile,
    "study.schema.json": StudyFile,
    "verify.schema.json": VerifyFile,
}


def schema_text(model: type[BaseModel]) -> str:
    """The JSON schema of a file's model, as published."""
    schema = {"$schema": "https://json-schema.org/draft/2020-12/schema"}
    return json.dumps(schema | model.model_json_schema(by_alias=True), indent=2) + "\n"


def write_all() -> None:
    """Write every schema into `cell/schemas/`."""
    FOLDER.mkdir(exist_ok=True)
    for name, model in MODELS.items():
        (FOLDER / name).write_text(schema_text(model), encoding="utf-8")


if __name__ == "__main__":
    write_all()
