"""The edge server keeps to its own OpenAPI document; `make soak` asks it far more."""

from pathlib import Path

import pytest
from schemathesis import GenerationMode

from tests.support import contract_fuzz

EXAMPLES = 3
SEED = 42


@pytest.mark.first_case
@pytest.mark.parametrize("mode", contract_fuzz.MODES, ids=lambda mode: mode.value)
def test_every_operation_keeps_to_the_document(tmp_path: Path, mode: GenerationMode) -> None:
    with contract_fuzz.served(tmp_path) as (app, keys):
        assert list(contract_fuzz.failures(app, keys, mode, EXAMPLES, SEED)) == []
