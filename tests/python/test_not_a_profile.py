"""Files that are no profile and no backup: what is wrong is said by file and line, and nothing of them is printed."""

from __future__ import annotations

import os
import re
from pathlib import Path

import pytest
from click.testing import CliRunner

from drivebus import Backup, Bus, NotAllowed, Profile
from drivebus.cli import cli

pytestmark = pytest.mark.skipif(os.name == "nt", reason="links need a privilege")

SECRET = "hunter2swordfish"
OTHERS = {
    "shadow": f"root:$6${SECRET}:19000:0:99999:7:::\ndaemon:{SECRET}:19000::::::\n",
    "one word": SECRET,
    "a key": f"-----BEGIN OPENSSH PRIVATE KEY-----\n{SECRET}\n-----END OPENSSH PRIVATE KEY-----\n",
    "variables": f"TOKEN={SECRET}\nexport PASSWORD='{SECRET}'\n",
    "TOML of another program": f'[registry]\ntoken = "{SECRET}"\n{SECRET} = 5\n',
    "TOML with a name": f'name = "service"\nversion = "{SECRET}"\nkind = "{SECRET}"\n[vars]\n{SECRET} = "{SECRET}"\n',
    "TOML that breaks off": f'name = "service"\nversion = 1\npassword = {SECRET}\n',
    "TOML with text that is not closed": f'name = "service"\npassword = "{SECRET}\n',
    "TOML with a key twice": f"{SECRET} = 1\n{SECRET} = 2\n",
    "TOML with an escape": f'password = "\\q{SECRET}"\n',
    "a table": f"user,password,name\nroot,{SECRET},x\n",
    "a table with secret columns": f"name,{SECRET},{SECRET}2\nroot,a,b\n",
    "a table with semicolons": f"name;{SECRET}\nroot;{SECRET}\n",
    "JSON": f'{{"password": "{SECRET}"}}\n',
    "YAML": f"password: {SECRET}\nname: x\n",
}
HEAD = 'name = "ours"\nversion = 1\nsource = "notes"\n[overlay]\nprofile = "gd350"\n'
FILES = ("profile.toml", "registers.csv", "parameters.csv", "faults.csv")


@pytest.fixture(params=list(OTHERS.values()), ids=list(OTHERS))
def other(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    path = tmp_path / "other"
    path.write_text(str(request.param))
    return path


def check(told: str) -> None:
    """Nothing of the secret was told, whole or in part."""
    assert re.search(f"{SECRET[:6]}|{SECRET[-6:]}", told) is None, told


@pytest.mark.parametrize("name", FILES)
def test_a_file_that_is_no_profile_is_named_and_not_shown(other: Path, tmp_path: Path, name: str) -> None:
    folder = tmp_path / "folder"
    folder.mkdir()
    if name != "profile.toml":
        (folder / "profile.toml").write_text(HEAD)
    (folder / name).symlink_to(other)
    problems = Profile.check(folder)
    assert problems
    assert problems[0]["file"] == str(folder / name)
    check(repr(problems))
    with pytest.raises(NotAllowed) as refused:
        Profile.load(folder)
    check(str(refused.value))
    for words in (["profiles", "check", str(folder)], ["--profile", str(folder), "describe", "x"]):
        for how in ([], ["--json"]):
            done = CliRunner().invoke(cli, [*how, *words])
            assert done.exit_code == 2
            check(done.output + done.stderr)


def test_a_file_where_a_folder_belongs(other: Path) -> None:
    check(repr(Profile.check(other)))
    done = CliRunner().invoke(cli, ["--profile", str(other), "describe", "x"])
    assert done.exit_code == 2
    check(done.output + done.stderr)


def test_a_file_that_is_no_backup_is_named_and_not_shown(other: Path) -> None:
    with pytest.raises(NotAllowed, match="cannot be used") as refused:
        Backup.load(other)
    check(str(refused.value))
    with Bus("sim://gd350?clock=virtual") as bus:
        drive = bus.drive(1)
        for call in (lambda: drive.backup(other), lambda: drive.diff(other), lambda: drive.restore(other)):
            with pytest.raises(NotAllowed) as refused:
                call()
            check(str(refused.value))


def test_of_what_is_a_profile_the_wrong_word_is_shown(tmp_path: Path) -> None:
    (tmp_path / "profile.toml").write_text(HEAD.replace("overlay", "overlai"))
    assert any('"overlai"' in problem["reason"] for problem in Profile.check(tmp_path))
    (tmp_path / "profile.toml").write_text(HEAD)
    (tmp_path / "faults.csv").write_text("code,mnemonik,label,cause,remedy,verified,note,source\n")
    [problem] = Profile.check(tmp_path)
    assert (problem["line"], '"mnemonik"' in problem["reason"]) == (1, True)
