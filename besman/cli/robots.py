"""``besman robots``: what there is, and your own arm."""

from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from besman.cli.options import ALL_CORES, Jobs


class _RobotsGroup(TyperGroup):
    """What is no command of ``robots`` is the name of a robot to show."""

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """Put ``show`` before a name."""
        is_name = args[0] not in self.commands and not args[0].startswith("-")
        return super().resolve_command(ctx, ["show", *args] if is_name else args)


robots = typer.Typer(
    cls=_RobotsGroup, invoke_without_command=True, subcommand_metavar="[NAME | add | check | try]"
)


@robots.callback()
def _robots(context: typer.Context) -> None:
    """Show which robots there are, or one in full; add, check and try your own."""
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


Tip = Annotated[
    str | None, typer.Option(help="Link that tools are mounted on; default the last one.")
]
Base = Annotated[
    str | None, typer.Option(help="Link that the arm stands on; what moves that one is held.")
]
Name = Annotated[str | None, typer.Option(help="Name; default the one in the file.")]
Package = Annotated[
    list[str] | None, typer.Option(help="NAME=FOLDER of package://NAME; repeatable.")
]
Velocity = Annotated[
    str | None, typer.Option(help="Degrees/s where none is given: one, or one a joint, by ','.")
]
Torque = Annotated[
    str | None, typer.Option(help="Nm where none is given: one, or one a joint, by ','.")
]

Arg = Annotated[list[str] | None, typer.Option(help="NAME=VALUE of a xacro; repeatable.")]


@robots.command("add")
def _add_robot(
    file: Annotated[Path, typer.Argument(help="URDF, xacro or MJCF of your arm.")],
    tip: Tip = None,
    name: Name = None,
    out: Annotated[Path | None, typer.Option(help="Folder; default beside the file.")] = None,
    package: Package = None,
    velocity: Velocity = None,
    torque: Torque = None,
    arg: Arg = None,
    base: Base = None,
) -> None:
    """Write NAME.yaml for your own arm, and say what to look at in it."""
    from besman.cli.progress_bars import stage_display
    from besman.cli.terminal import open_terminal
    from besman.robot.files.mesh_folders import parse_packages
    from besman.robot.files.xacro_file import parse_arguments
    from besman.robot.new_robot import add_robot

    with stage_display() as show:
        path = add_robot(
            file,
            tip,
            name,
            out,
            packages=parse_packages(package or []),
            velocity=velocity,
            torque=torque,
            arguments=parse_arguments(arg or []),
            base=base,
            show=show,
        )
    open_terminal().print(f"wrote {path}", soft_wrap=True)
    _print_doubts(str(path))


@robots.command("try")
def _try_robot(
    robot: Annotated[
        str, typer.Argument(help="A robot, a robot.yaml, or the URDF, xacro or MJCF of an arm.")
    ],
    tool: Annotated[str, typer.Option(help="What it carries.")] = "stick_holder",
    out: Annotated[
        Path | None, typer.Option(help="Folder of page and run; default runs/try_NAME.")
    ] = None,
    tip: Tip = None,
    name: Name = None,
    package: Package = None,
    velocity: Velocity = None,
    torque: Torque = None,
    arg: Arg = None,
    base: Base = None,
    jobs: Jobs = ALL_CORES,
) -> None:
    """Take the embedded throws to an arm and write a page: what it is, what it can do, why not."""
    from besman.cli.progress_bars import stage_display
    from besman.cli.terminal import open_terminal
    from besman.robot.files.mesh_folders import parse_packages
    from besman.robot.files.xacro_file import parse_arguments
    from besman.robot.new_robot import Wishes
    from besman.view.try_robot import try_robot

    console = open_terminal()
    packages, arguments = parse_packages(package or []), parse_arguments(arg or [])
    wishes = Wishes(tip, name, None, packages, velocity, torque, arguments, base)
    with stage_display() as show:
        tried = try_robot(
            robot,
            wishes,
            tool,
            out,
            jobs=jobs,
            show=show,
            say=lambda line: console.print(line, soft_wrap=True),
        )
    for line in tried.said:
        console.print(line, soft_wrap=True)
    console.print(f"robot: {tried.robot}", soft_wrap=True)
    console.print(f"page: {tried.page}", soft_wrap=True)


@robots.command("check")
def _check_robot(name: Annotated[str, typer.Argument(help="A robot, or a robot.yaml.")]) -> None:
    """Say what is missing or doubtful in a robot; exit code 1 if it cannot be used."""
    if _print_doubts(name):
        raise typer.Exit(1)


def _print_doubts(name: str) -> bool:
    """Print what is missing or doubtful; tell whether something is missing."""
    from besman.cli.terminal import open_terminal
    from besman.robot.description_faults import check_robot

    console = open_terminal()
    doubts = check_robot(name)
    for doubt in doubts:
        console.print(f"{doubt.kind:9} {doubt.text}", soft_wrap=True)
    if not doubts:
        console.print("nothing is missing or doubtful")
    return any(doubt.kind == "missing" for doubt in doubts)
