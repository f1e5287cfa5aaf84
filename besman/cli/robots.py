"""``besman robots``: what there is, and your own arm."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperGroup


class _RobotsGroup(TyperGroup):
    """What is no command of ``robots`` is the name of a robot to show."""

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """Put ``show`` before a name."""
        is_name = args[0] not in self.commands and not args[0].startswith("-")
        return super().resolve_command(ctx, ["show", *args] if is_name else args)


robots = typer.Typer(
    cls=_RobotsGroup, invoke_without_command=True, subcommand_metavar="[NAME | add | check]"
)


@robots.callback()
def _robots(context: typer.Context) -> None:
    """Show which robots there are, or one in full; add and check your own."""
    if context.invoked_subcommand is None:
        from besman.cli.terminal import open_terminal
        from besman.report.robot_tables import robots_table

        open_terminal().print(robots_table())


@robots.command("show", hidden=True)
def _show_robot(name: Annotated[str, typer.Argument(help="A robot.")]) -> None:
    """Show a robot's limits, and where its numbers come from."""
    from besman.cli.terminal import open_terminal
    from besman.report.robot_tables import robot_table

    open_terminal().print(robot_table(name))


@robots.command("add")
def _add_robot(
    urdf: Annotated[Path, typer.Argument(help="URDF or MJCF of your arm.")],
    tip: Annotated[
        str | None, typer.Option(help="Link that tools are mounted on; default the last one.")
    ] = None,
    name: Annotated[str | None, typer.Option(help="Name; default the URDF's.")] = None,
    out: Annotated[Path | None, typer.Option(help="Folder; default beside the URDF.")] = None,
    package: Annotated[
        list[str] | None, typer.Option(help="NAME=FOLDER of package://NAME; repeatable.")
    ] = None,
    velocity: Annotated[
        str | None, typer.Option(help="Degrees/s where none is given: one, or one a joint, by ','.")
    ] = None,
    torque: Annotated[
        str | None, typer.Option(help="Nm where none is given: one, or one a joint, by ','.")
    ] = None,
) -> None:
    """Write NAME.yaml for your own arm, and say what to look at in it."""
    from besman.cli.progress_bars import stage_display
    from besman.cli.terminal import open_terminal
    from besman.robot.files.mesh_folders import parse_packages
    from besman.robot.new_robot import add_robot

    with stage_display() as show:
        path = add_robot(
            urdf,
            tip,
            name,
            out,
            packages=parse_packages(package or []),
            velocity=velocity,
            torque=torque,
            show=show,
        )
    open_terminal().print(f"wrote {path}", soft_wrap=True)
    _print_doubts(str(path))


@robots.command("check")
def _check_robot(name: Annotated[str, typer.Argument(help="A robot, or a robot.yaml.")]) -> None:
    """Say what is missing or doubtful in a robot; exit code 1 if it cannot be used."""
    if _print_doubts(name):
        raise typer.Exit(1)


def _print_doubts(name: str) -> bool:
    """Print what is missing or doubtful; tell whether something is missing."""
    from besman.cli.terminal import open_terminal
    from besman.robot.doubts import check_robot

    console = open_terminal()
    doubts = check_robot(name)
    for doubt in doubts:
        console.print(f"{doubt.kind:9} {doubt.text}", soft_wrap=True)
    if not doubts:
        console.print("nothing is missing or doubtful")
    return any(doubt.kind == "missing" for doubt in doubts)
