"""Write the edge server's OpenAPI document: `python -m docs.tools.openapi_document FILE`.

The console's types and forms are generated from it, so no edge server has to run for a build.
"""

import json
import sys
import tempfile
from pathlib import Path
from typing import Any, cast

from edge_server.api.routes import documentation
from edge_server.app import create_app
from edge_server.config import Config


def document() -> dict[str, Any]:
    """Give the document of an edge server with default settings."""
    with tempfile.TemporaryDirectory() as folder:
        config = Config(state_dir=Path(folder))
        config.edge_dir.mkdir(parents=True)
        app = create_app(config)
        with app.app_context():
            return cast("dict[str, Any]", documentation.show_document())


def main(path: Path) -> None:
    """Write the document, complete or not at all."""
    text = json.dumps(document(), indent=1, sort_keys=True) + "\n"
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_suffix(".part")
    part.write_text(text)
    part.replace(path)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
