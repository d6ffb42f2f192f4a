"""The recipes of docs/architecture.md are complete, and no step of them can be left out.

Here their edits are made together, and the linter is asked. `make recipes` tries what they lead to,
all together and one by one, whole and with each step left out: each takes a Python of its own or
three.
"""

import re
from pathlib import Path

import pytest

from tests.recipes.recipes import EFFECT, RECIPES
from tests.recipes.steps import (
    COPIED,
    ROOT,
    Insert,
    Recipe,
    Step,
    copy_of_the_tree,
    run,
    together,
)

pytestmark = pytest.mark.timeout(1200)

PAGE = (ROOT / "docs" / "architecture.md").read_text()
WITHOUT = [
    pytest.param(recipe, step, id=f"{recipe.name} without {step.name}")
    for recipe in RECIPES
    for step in recipe.steps
]


@pytest.mark.campaign
def test_what_the_recipes_say_together_is_enough(tmp_path: Path) -> None:
    # Without types and without the kernel, which an effect compiles anew.
    recipe = together([recipe for recipe in RECIPES if recipe is not EFFECT])
    assert recipe.complaints(copy_of_the_tree(tmp_path, whole=False), None, types=False) == ""


def test_every_place_that_a_recipe_edits_is_there(tmp_path: Path) -> None:
    tree = copy_of_the_tree(tmp_path, whole=False)
    for recipe in RECIPES:
        for step in recipe.steps:
            if isinstance(step, Insert):
                step.carry_out(tree)
    for check in (("check", "-q", "."), ("format", "-q", "--check", ".")):
        done = run(tree, "-m", "ruff", *check)
        assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.campaign
@pytest.mark.parametrize("recipe", RECIPES, ids=lambda recipe: recipe.name)
def test_what_a_recipe_says_is_enough(recipe: Recipe, tmp_path: Path) -> None:
    assert recipe.complaints(copy_of_the_tree(tmp_path, whole=True), None) == ""


@pytest.mark.campaign
@pytest.mark.parametrize(("recipe", "step"), WITHOUT)
def test_a_step_that_is_left_out_is_noticed(recipe: Recipe, step: Step, tmp_path: Path) -> None:
    assert recipe.complaints(copy_of_the_tree(tmp_path, whole=False), step) != ""


@pytest.mark.parametrize("recipe", RECIPES, ids=lambda recipe: recipe.name)
def test_the_page_names_every_file_that_a_recipe_edits(recipe: Recipe) -> None:
    edited = {step.path for step in recipe.steps if isinstance(step, Insert) and step.before}
    assert [path for path in edited if Path(path).name not in PAGE] == []


def test_every_file_that_the_page_names_is_there() -> None:
    named = set(re.findall(r"`(?:[\w./]+/)?(\w+\.(?:py|c|h|toml|md))`", PAGE))
    there = {path.name for folder in COPIED for path in (ROOT / folder).rglob("*.*")}
    assert named - there == {"NAME.md", "NAME.py"}
