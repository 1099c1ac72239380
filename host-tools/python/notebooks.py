"""Makes the notebooks of docs/notebooks from the programs of docs/python.md, and runs them.

    python host-tools/python/notebooks.py docs/notebooks

Each program becomes a script and a notebook, with what it printed and drew; the page gets that below each program too.
"""

import base64
import contextlib
import io
import json
import re
import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402

PAGE = Path(__file__).parents[2] / "docs/python.md"
PICTURES = PAGE.parent / "images"
#: File names by the beginning of a section's heading.
NAMES = {"Fig. 5b": "fig-5b", "An oscilloscope": "oscilloscope", "Which absorbers": "absorbers"}


def sections():
    """Name, heading, text and program of each section that becomes a notebook."""
    for section in PAGE.read_text().split("\n## ")[1:]:
        heading, body = section.split("\n", 1)
        name = next((name for start, name in NAMES.items() if heading.startswith(start)), None)
        if name:
            text, program = re.match(r"(.*?)```python\n(.*?)```", body, re.DOTALL).groups()
            yield name, heading, text.strip(), program


def run(program):
    """What a program prints and draws, as the outputs of a cell."""
    printed = io.StringIO()
    plt.close("all")
    with contextlib.redirect_stdout(printed):
        exec(compile(program, "notebook", "exec"), {})
    outputs = [{"output_type": "stream", "name": "stdout", "text": printed.getvalue().splitlines(True)}]
    for number in plt.get_fignums():
        picture = io.BytesIO()
        plt.figure(number).savefig(picture, format="png", dpi=90, bbox_inches="tight", metadata={"Software": None})
        data = {"image/png": base64.b64encode(picture.getvalue()).decode(), "text/plain": ["a figure"]}
        outputs.append({"output_type": "display_data", "data": data, "metadata": {}})
    return outputs


def notebook(heading, text, program, outputs):
    """A notebook of format 4.5."""
    lines = f"# {heading}\n\n{text}".splitlines(True)
    code = {"cell_type": "code", "id": "program", "execution_count": 1, "metadata": {}}
    return {
        "cells": [
            {"cell_type": "markdown", "id": "text", "metadata": {}, "source": lines},
            {**code, "source": program.splitlines(True), "outputs": outputs},
        ],
        "metadata": {"language_info": {"name": "python"}},
        "nbformat": 4,
        "nbformat_minor": 5,
    }


def script(heading, text, program):
    """A script in the percent format, which editors open as a notebook."""
    lines = [f"# {line}".rstrip() for line in f"# {heading}\n\n{text}".splitlines()]
    return "\n".join(["# %% [markdown]", *lines, "", "# %%", program])


def shown(name, heading, program, outputs):
    """Writes what a program printed and drew into the page, below the program."""
    below = f"\n```text\n{''.join(outputs[0]['text'])}```\n"
    for drawn in outputs[1:]:
        picture = f"python-{name}.png"
        (PICTURES / picture).write_bytes(base64.b64decode(drawn["data"]["image/png"]))
        below += f"\n![{heading}](images/{picture})\n"
    block = f"```python\n{program}```\n"
    before = re.escape(block) + r"(\n```text\n.*?```\n)?(\n!\[[^\n]*\]\(images/python-[^\n]*\)\n)?"
    PAGE.write_text(re.sub(before, lambda _: block + below, PAGE.read_text(), flags=re.DOTALL))


def main(folder):
    folder.mkdir(parents=True, exist_ok=True)
    for name, heading, text, program in list(sections()):
        (folder / f"{name}.py").write_text(script(heading, text, program))
        outputs = run(program)
        shown(name, heading, program, outputs)
        whole = notebook(heading, text, program, outputs)
        (folder / f"{name}.ipynb").write_text(json.dumps(whole, indent=1, ensure_ascii=False) + "\n")
        print(f"wrote {folder / name}.py and .ipynb")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
