"""The command line."""

from __future__ import annotations

import io
import sys
from pathlib import Path
from typing import Annotated

import typer

from inspect3d import __version__
from inspect3d.demo import Demo
from inspect3d.outcome import InputError, InspectionError

DONE, UNANSWERED, WRONG_INPUT, BROKEN, INTERRUPTED = 0, 1, 2, 70, 130
"""Exit statuses: done; a measurement has no map; the recipe or a file is wrong; a mistake of ours; Ctrl-C."""

app = typer.Typer(
    help="Optical inspection: where, and by how much, a part differs from its CAD model, and how sure we are.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)

LOOPBACK = "127.0.0.1"
HostAddress = Annotated[
    str, typer.Option("--host", help="Address to listen on; any other than the default lets other computers in.")
]
OpenBrowser = Annotated[bool, typer.Option(help="Open the page in the browser of this desktop.")]
RecipePath = Annotated[Path, typer.Argument(metavar="RECIPE", help="The recipe, a TOML file.")]


def main() -> None:
    """Run the command line; an error becomes a sentence on standard error and an exit status."""
    arguments = [argument for argument in sys.argv[1:] if argument != "--debug"]
    debug = len(arguments) < len(sys.argv) - 1
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")
    try:
        app(arguments)
    except BaseException as error:
        if _interrupted(error):
            typer.echo("Interrupted; earlier results are untouched.", err=True)
            sys.exit(INTERRUPTED)
        if debug or not isinstance(error, Exception):
            raise
        typer.echo(_sentence(error), err=True)
        sys.exit(_exit_status(error))


def _interrupted(error: BaseException | None) -> bool:
    """Tell whether Ctrl-C was the reason: libraries, while they load, turn it into errors of their own."""
    while error is not None and not isinstance(error, KeyboardInterrupt):
        error = error.__cause__ or error.__context__
    return error is not None


def _sentence(error: Exception) -> str:
    if isinstance(error, InspectionError):
        return str(error)
    if isinstance(error, OSError):
        return f"{error.filename or 'A file'}: {error.strerror or error}."
    if isinstance(error, ImportError):
        from inspect3d.system import import_words

        return import_words(error)
    if isinstance(error, MemoryError):
        return "There is not enough memory; a larger element_size or fewer points need less."
    return f"inspect3d made a mistake of its own ({type(error).__name__}: {error}); please report it with --debug."


def _exit_status(error: Exception) -> int:
    if isinstance(error, InputError | OSError):
        return WRONG_INPUT
    return UNANSWERED if isinstance(error, InspectionError | MemoryError | ImportError) else BROKEN


def _show_version(asked: bool) -> None:
    if asked:
        typer.echo(f"inspect3d {__version__}")
        raise typer.Exit


@app.callback()
def _options(
    debug: Annotated[bool, typer.Option("--debug", help="Show the traceback of an error.")] = False,
    version: Annotated[
        bool, typer.Option("--version", callback=_show_version, is_eager=True, help="Show the version.")
    ] = False,
) -> None:
    """Take the options that every command has; `main` sees to `--debug`."""


@app.command()
def run(
    recipe: RecipePath,
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="Folder of the results; default: out/ and the recipe's name.")
    ] = None,
) -> None:
    """Inspect a part; leave maps, pictures and a report."""
    _inspect(recipe, out or Path("out") / recipe.stem)


@app.command()
def demo(
    name: Annotated[Demo, typer.Argument(help="The part: by several methods, or by a small scan.")] = Demo.MILLED,
    out: Annotated[Path, typer.Option("--out", "-o", help="Folder of the results.")] = Path("out/demo"),
) -> None:
    """Inspect a virtual part; its data set stays beside the results."""
    from inspect3d.demo import demo_recipe
    from inspect3d.terminal import terminal

    with terminal(sys.stderr) as progress:
        recipe = demo_recipe(name, out.with_name(f"{out.name}-data"), progress)
    _inspect(recipe, out)


@app.command()
def compare(
    folders: Annotated[list[Path], typer.Argument(metavar="OUT...", help="Folders of finished inspections.")],
    out: Annotated[Path, typer.Option("--out", "-o", help="Folder of the results.")] = Path("out/compare"),
) -> None:
    """Compare inspections of one part that were run separately; leave one report."""
    from inspect3d.comparing import compare_runs
    from inspect3d.summary import summary
    from inspect3d.terminal import terminal

    with terminal(sys.stderr) as progress:
        record = compare_runs(folders, out, progress)
    for line in summary(record, out):
        typer.echo(line)


@app.command()
def check(recipe: RecipePath) -> None:
    """Check a recipe and its files without measuring."""
    from inspect3d.inspection import check

    for line in check(recipe):
        typer.echo(line)


@app.command()
def methods() -> None:
    """List the installed measuring methods and their settings."""
    from inspect3d.listing import listing

    for line in listing():
        typer.echo(line)


@app.command()
def screenshot(
    out: Annotated[Path, typer.Argument(metavar="OUT", help="Folder of a finished inspection.")],
    file: Annotated[Path, typer.Option("--output", "-o", help="The picture to write.")] = Path("screenshot.png"),
    name: Annotated[str | None, typer.Option(help="The measurement; default: the first.")] = None,
    field: Annotated[str, typer.Option(help="deviation, sigma, verdict, ...")] = "deviation",
    view: Annotated[str, typer.Option(help="iso, front, top, +x, -y+z, ...")] = "iso",
    size: Annotated[tuple[int, int], typer.Option(help="Width and height, pixels.")] = (1600, 1200),
    limits: Annotated[tuple[float, float] | None, typer.Option(help="Ends of the colour bar.")] = None,
) -> None:
    """Draw any field of a finished inspection from any side."""
    from inspect3d.report.screenshot import screenshot

    screenshot(out, file, name=name, field=field, view=view, size=size, limits=limits)
    typer.echo(f"picture: {file}")


@app.command()
def pick(
    recipe: RecipePath,
    out: Annotated[
        Path | None,
        typer.Option("--out", "-o", help="Results of the last run, for the candidates of an ambiguous start."),
    ] = None,
    host: HostAddress = LOOPBACK,
    browser: OpenBrowser = True,
) -> None:
    """Click in the browser on the same points of the CAD and of photographs or a cloud; saved as landmarks."""
    from inspect3d.terminal import terminal
    from inspect3d.web.pick_page import pick_of
    from inspect3d.web.serve import serve

    with terminal(sys.stderr) as progress, progress.stage("reading the files"):
        found = pick_of(recipe, out or Path("out") / recipe.stem)
    serve(found.page, host, browser, typer.echo)


@app.command()
def view(
    out: Annotated[list[Path], typer.Argument(metavar="OUT...", help="Folders of finished inspections.")],
    recipe: Annotated[
        Path | None, typer.Option(help="The recipe that flags are saved in; default: looked for near the first OUT.")
    ] = None,
    host: HostAddress = LOOPBACK,
    browser: OpenBrowser = True,
) -> None:
    """Show maps side by side in the browser: fields, values, sections, flags."""
    from inspect3d.web.serve import serve
    from inspect3d.web.view_page import view_of

    found = view_of(out, recipe)
    for words in found.damaged:
        typer.echo(f"warning: {words}", err=True)
    serve(found.page, host, browser, typer.echo)


@app.command()
def virtual(
    name: Annotated[str, typer.Argument(help="bracket, smooth-stereo, ... or a plan.toml of your own.")],
    out: Annotated[Path, typer.Option("--out", "-o", help="Folder of the data set.")],
    seed: Annotated[int, typer.Option(min=0, help="Seed of the random numbers.")] = 0,
) -> None:
    """Make a data set with a known truth: CAD, simulated measurement, recipe."""
    from inspect3d.terminal import terminal
    from inspect3d.virtual.datasets import make_dataset

    with terminal(sys.stderr) as progress, progress.stage(f"making {name}"):
        make_dataset(name, out, seed)
    typer.echo(f"recipe: {out / 'recipe.toml'}")


@app.command()
def doctor() -> None:
    """Check everything a machine needs, rendering included."""
    from inspect3d.doctor import examine

    findings = examine()
    for finding in findings:
        typer.echo(f"{'ok  ' if finding.well else 'FAIL'} {finding.what}: {finding.words}")
    raise typer.Exit(DONE if all(finding.well for finding in findings) else UNANSWERED)


def _inspect(recipe: Path, out: Path) -> None:
    from inspect3d.inspection import run
    from inspect3d.summary import summary
    from inspect3d.terminal import terminal

    with terminal(sys.stderr) as progress:
        record = run(recipe, out, progress)
    for line in summary(record, out):
        typer.echo(line)
    raise typer.Exit(DONE if all(part.status.has_map for part in record.parts) else UNANSWERED)
