#!/usr/bin/env python3
"""Runs the code of a notebook, cell by cell in one namespace, without Jupyter: run_notebook.py NOTEBOOK

Each cell must run; plots are drawn to nowhere. The value of a cell's last line is printed, as Jupyter shows it.
"""
import ast
import json
import os
import sys
from pathlib import Path

os.environ["MPLBACKEND"] = "Agg"


def run(cells: list[dict], name: str) -> None:
    namespace: dict[str, object] = {"__name__": "__main__"}
    for number, cell in enumerate(cells):
        if cell["cell_type"] != "code":
            continue
        code, place = "".join(cell["source"]), f"{name}, cell {number}"
        tree = ast.parse(code, place)
        last = tree.body.pop() if isinstance(tree.body[-1], ast.Expr) else None
        exec(compile(tree, place, "exec"), namespace)
        if last is not None:
            value = eval(compile(ast.Expression(last.value), place, "eval"), namespace)
            if value is not None and not code.endswith(";"):
                print(value)


def main() -> int:
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    notebook = json.loads(Path(sys.argv[1]).read_text())
    if any(cell.get("outputs") for cell in notebook["cells"]):
        print(f"error: {sys.argv[1]} has outputs, which belong to nobody's run; clear them", file=sys.stderr)
        return 1
    run(notebook["cells"], Path(sys.argv[1]).name)
    return 0


if __name__ == "__main__":
    sys.exit(main())
