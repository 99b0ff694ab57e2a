"""`mcloc models`: the parts that runs are made of, with their parameters."""

import math
from typing import Annotated, Any

import typer


def show_models(
    json: Annotated[bool, typer.Option("--json", help="As JSON, and nothing else.")] = False,
) -> None:
    """List the filters and their parts, with parameters, units, defaults and limits.

    A part is chosen by its name (--motion odometry); its parameters are set by
    --set PART.NAME=VALUE, such as --set motion.alpha1=0.2.
    """
    from mcloc.report.summary import to_json

    found = _models()
    if json:
        typer.echo(to_json(found), nl=False)
    else:
        _print(found)


def _models() -> dict[str, Any]:
    """{kind: {name: {"doc", "default": whether it is the one used, "parameters"}}}."""
    from mcloc.config import CHOICES, RunConfig
    from mcloc.localizer import UpdatePolicy
    from mcloc.report.joined import OF_MEMBER

    models = {
        kind: {
            name: _model(part, default=getattr(RunConfig, kind) == name)
            for name, part in registry.parts.items()
        }
        for kind, registry in CHOICES.items()
    }
    single = {"update": UpdatePolicy, **OF_MEMBER}
    models.update({kind: {kind: _model(part, default=True)} for kind, part in single.items()})
    return models


def _model(part: Any, default: bool) -> dict[str, Any]:
    from mcloc.registry import parameters

    listed = {f.name: _parameter(f) for f in parameters(part)}
    doc = (part.__doc__ or "").split("\n\n")[0]
    return {"doc": " ".join(doc.split()), "default": default, "parameters": listed}


def _parameter(field: Any) -> dict[str, Any]:
    limits = field.metadata
    return {
        "default": field.default,
        "unit": limits["unit"],
        "limits": _limits(limits),
        "doc": limits["doc"],
    }


def _limits(limits: Any) -> str:
    if limits["choices"]:
        return " | ".join(limits["choices"])
    bounds = [("> ", limits["above"]), (">= ", limits["low"]), ("<= ", limits["high"])]
    return ", ".join(f"{sign}{bound:g}" for sign, bound in bounds if math.isfinite(bound))


def _print(models: dict[str, Any]) -> None:
    from rich.console import Console
    from rich.table import Column, Table
    from rich.text import Text

    console = Console()
    for kind, parts in models.items():
        for name, model in parts.items():
            title = Text.assemble((f"{kind} ", "bold"), (name, "bold cyan"))
            if kind == name:  # there is only this one
                title = Text(kind, style="bold")
            elif model["default"]:
                title.append(" (default)")
            console.print(title, Text(model["doc"], style="dim"), sep="\n")
            if model["parameters"]:
                whole = Column("--set", no_wrap=True, overflow="fold")  # names are to be copied
                table = Table(whole, "default", "unit", "limits", "meaning", box=None)
                for parameter, p in model["parameters"].items():
                    cells = (f"{kind}.{parameter}", str(p["default"]), *list(p.values())[1:])
                    table.add_row(*map(Text, cells))
                console.print(table)
            console.print()
