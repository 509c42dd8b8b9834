"""`halflight warm`: compile the kernels and keep them on disk."""

from __future__ import annotations

import time

import typer

from halflight.console import progress_bar


def warm() -> None:
    """Compile all kernels, so that nothing later waits for a compiler.

    They are kept on disk. What is compiled already is only loaded, so that a second time takes a moment.
    """
    from solver.engine.drawing import Drawing
    from solver.engine.warm import warm_steps

    start = time.perf_counter()
    drawing = Drawing()
    steps = warm_steps(drawing)
    with progress_bar() as bar:
        task = bar.add_task("Compiling", total=len(steps), note="")
        for step in steps:
            bar.update(task, note=step.name)
            step.run()
            bar.advance(task)
        bar.update(task, note="")
    typer.echo(f"kernels are compiled ({time.perf_counter() - start:.1f} s)")
