"""Imports a recording of krait with Rerun's own importer and prints the components of each entity as one line of JSON.

Usage: python import_with_rerun.py FILE
Needs: pip install rerun-sdk==0.41.0
"""

import json
import os
import sys
import tempfile

import rerun
from rerun.chunk import RrdReader


def components(path):
    with tempfile.TemporaryDirectory() as folder:
        imported = os.path.join(folder, "imported.rrd")
        stream = rerun.RecordingStream("krait")
        stream.save(imported)
        stream.log_file_from_path(path)
        stream.flush()
        stream.disconnect()
        schema = RrdReader(imported).store().schema()
        found = {}
        for column in schema.component_columns():
            found.setdefault(column.entity_path, []).append(column.component)
        return {"entities": found, "timelines": [index.name for index in schema.index_columns()]}


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("usage: python import_with_rerun.py FILE")
    print(json.dumps(components(sys.argv[1])))
