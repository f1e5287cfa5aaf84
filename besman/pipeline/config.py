"""The config of a pipeline: one complete recipe, read from YAML."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import yaml
from pydantic import Field, field_validator, model_validator

from besman.config.settings import PathKeys, absolute, apply_settings, own_file, resolve_paths
from besman.config.stage import Config
from besman.config.yaml_file import parse_config, read_yaml
from besman.exceptions import ConfigError, nearest
from besman.person.marker_set import load_marker_set
from besman.robot.model import find_tool
from besman.simulation.tasks.kinds import load_whole_task
from besman.stages.compose.stage import ComposeConfig
from besman.stages.imitate.methods import ImitateStage
from besman.stages.imitate.stage import ImitateConfig
from besman.stages.label.methods import DefaultLabelConfig, LabelStage
from besman.stages.label.stage import NamingBase
from besman.stages.map.stage import MapConfig
from besman.stages.read.config import ReadConfig
from besman.stages.recognize.one_throw import OneThrowConfig
from besman.stages.recognize.stage import RecognizeConfig, RecognizeStage
from besman.stages.refine.methods import RefineStage
from besman.stages.refine.stage import CmaEsConfig
from besman.stages.segment.methods import DefaultSegmentConfig, SegmentStage
from besman.stages.select.stage import SelectConfig

if TYPE_CHECKING:
    from besman.simulation.tasks.rearrange.rearrange import RearrangeConfig

# Relative to the file they stand in, or to the working directory where a setting has them. A name
# of a robot or a task that is there is no path.
PATHS: PathKeys = {
    "recordings": absolute,
    "training": absolute,
    "label.learn_from": absolute,
    "recognize.model": absolute,
    "select.landing": absolute,
    "robot": own_file,
    "second_arm.robot": own_file,
    "task": own_file,
}


class SecondArmConfig(Config):
    """The other arm of a robot with two, for the person's other hand.

    Attributes
    ----------
    robot, tool : str
        As of the pipeline; both arms stand in one world.
    """

    robot: str
    tool: str


class PipelineConfig(Config):
    """One complete recipe: recordings, robot, and the stages in their order.

    Attributes
    ----------
    name : str
        Name of the run folder.
    recordings : tuple of str
        Files or folders; relative to the YAML file.
    training : tuple of str
        Recordings with a segments file beside them, from which labelled examples are taken;
        none given: the recordings themselves.
    robot, tool : str
        A robot of ``robots/`` or the path of a robot.yaml, and one of its tools.
    second_arm : SecondArmConfig, optional
        What the person's other hand does is mapped to this arm, with the same placement and at the
        same time; imitation and refinement treat each arm by itself.
    task : str
        A task of ``configs/tasks/`` or a path.
    margin_s : float
        Greatest distance of a found border to a manual one that counts as found, where there are
        manual segments.
    read : ReadConfig
        What the files of recordings leave open: their units and which axis points up.
    compose : ComposeConfig, optional
        Makes actions of building blocks, for ``select: {action: NAME}``.
    label, segment, recognize, select, map, imitate, refine
        The stages.
    """

    name: Annotated[str, Field(pattern=r"^[\w.-]+$")]
    recordings: Annotated[tuple[str, ...], Field(min_length=1)]
    training: tuple[str, ...] = ()
    robot: str
    tool: str
    second_arm: SecondArmConfig | None = None
    task: str
    margin_s: Annotated[float, Field(gt=0)] = 0.3
    read: ReadConfig = ReadConfig()
    label: LabelStage = DefaultLabelConfig()
    segment: SegmentStage = DefaultSegmentConfig()
    recognize: RecognizeStage = RecognizeConfig()
    compose: ComposeConfig | None = None
    select: SelectConfig
    map: MapConfig = MapConfig()
    imitate: ImitateStage = ImitateConfig()
    refine: RefineStage = CmaEsConfig()

    @field_validator("recordings", "training", mode="before")
    @classmethod
    def _one_or_many(cls, value: Any) -> Any:
        """Accept a single path in place of a list of one."""
        return (value,) if isinstance(value, str) else value

    @model_validator(mode="after")
    def _check_action(self) -> PipelineConfig:
        """Refuse an action that no level of `compose` has, if nothing else may know it."""
        action = self.select.action
        # Of several the stage itself has looked.
        if isinstance(action, tuple) or action in self.select.actions:
            return self
        if self.compose is None and self.select.as_ == "blocks":
            return self
        known = () if self.compose is None else self.compose.actions
        if action is not None and action not in known:
            raise ValueError(
                f"select.action: got {action!r}; {nearest(action, known)} (compose.levels)"
            )
        return self

    @model_validator(mode="after")
    def _check_blocks(self) -> PipelineConfig:
        """Refuse blocks of two arms."""
        if self.second_arm is not None and self.select.as_ == "blocks":
            raise ValueError(
                "select.as: blocks are those of one arm; expected no second_arm, or as: movement"
            )
        return self

    @model_validator(mode="after")
    def _check_one_throw(self) -> PipelineConfig:
        """Refuse what the method without examples cannot give."""
        if not isinstance(self.recognize, OneThrowConfig):
            return self
        if self.compose is not None:
            raise ValueError(
                "recognize.method: one_throw names single movements; compose needs a method that "
                "learns from labelled examples"
            )
        label, known = self.select.label, self.recognize.labels
        if label not in known:
            raise ValueError(f"select.label: got {label!r}; {nearest(str(label), known)}")
        return self


def load_pipeline(path: Path, settings: tuple[str, ...] = ()) -> PipelineConfig:
    """Read a pipeline and make its paths absolute.

    Parameters
    ----------
    path : Path
        The YAML file.
    settings : tuple of str
        ``KEY=VALUE`` with a dotted key and a YAML value, see
        `besman.config.settings.apply_settings`.

    Returns
    -------
    PipelineConfig

    Raises
    ------
    ConfigError
        For anything in the file or the settings that does not fit.
    """
    content, lines = read_yaml(path)
    resolve_paths(content, path.resolve().parent, PATHS)
    apply_settings(content, settings, PipelineConfig, PATHS)
    content = {k: v for k, v in content.items() if v is not None}
    keys = [setting.partition("=")[0] for setting in settings]
    return _look_at_arms(parse_config(content, PipelineConfig, path, lines, keys))


def _look_at_arms(config: PipelineConfig) -> PipelineConfig:
    """Let stages whose section names no markers look at the arms of the marker set."""
    marker_set = load_marker_set(config.label.markers)
    changes: dict[str, Any] = {}
    if marker_set.hand and "markers" not in config.segment.model_fields_set:
        changes["segment"] = config.segment.model_copy(update={"markers": marker_set.hand})
    if config.compose is not None and marker_set.arms:
        usual = {"markers": marker_set.arms, "hands": marker_set.hands}
        unset = {k: v for k, v in usual.items() if k not in config.compose.model_fields_set}
        changes["compose"] = config.compose.model_copy(update=unset)
    return config.model_copy(update=changes)


def pipeline_yaml(config: PipelineConfig) -> str:
    """Return a pipeline with every default written out."""
    plain = config.model_dump(mode="json")
    return str(yaml.safe_dump(plain, sort_keys=False, allow_unicode=True))


def check_whole_task(config: PipelineConfig) -> RearrangeConfig:
    """Return the task of a recipe of whole actions; refuse what does not belong together.

    Raises
    ------
    ConfigError
        If the recipe is not of whole actions.
    RefinementError
        If the tool is not the task's.
    """
    task = load_whole_task(config.task)
    if config.select.as_ != "blocks":
        raise ConfigError(
            f"task: {config.task} is one of whole actions; expected select.as: blocks, got "
            f"{config.select.as_}"
        )
    robot = find_tool(config.robot, config.tool)
    task.check_tool(robot.name, config.tool)
    return task


def needs_no_examples(config: PipelineConfig) -> bool:
    """Tell whether nothing is learnt: a trained model is given, or none is needed."""
    return not config.recognize.learns and config.compose is None


def learn_from(config: PipelineConfig) -> str | None:
    """Return the path of the recording that the label stage learns from, if it does."""
    return config.label.learn_from if isinstance(config.label, NamingBase) else None
