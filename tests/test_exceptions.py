"""What is made of the errors of other libraries."""

import pytest

from besman.exceptions import in_one_line, why_not_there

FROM_CPP = """
From file: /project/src/mesh_loader/assimp.cpp
in function: void coal::internal::Loader::load(const std::string&)
at line: 91
message: Could not load resource /data/no.stl
Unable to open file "/data/no.stl".
Hint: the mesh directory may be wrong.
"""

FROM_OPENGL = "EGLError(\n\terr = EGL_NOT_INITIALIZED,\n\tbaseOperation = eglInitialize\n)"


@pytest.mark.parametrize(
    ("error", "said"),
    [
        (ValueError("one line"), "one line"),
        (
            ValueError(FROM_CPP),
            'Could not load resource /data/no.stl; Unable to open file "/data/no.stl". '
            "Hint: the mesh directory may be wrong.",
        ),
        (
            RuntimeError(FROM_OPENGL),
            "EGLError( err = EGL_NOT_INITIALIZED, baseOperation = eglInitialize )",
        ),
        (RuntimeError(), "RuntimeError"),
        (RuntimeError("\n \n"), "RuntimeError"),
        (KeyError("mass"), "KeyError: 'mass'"),
        (KeyError(), "KeyError"),
        (
            ["Error:  Joint [j] has no type [x]", " at line 5 in /p/j.cpp"],
            "Joint [j] has no type [x]",
        ),
        ([], ""),
    ],
)
def test_all_that_was_said_is_in_one_line(error, said):
    assert in_one_line(error) == said


def test_a_library_that_is_there_and_broken_is_not_called_missing():
    broken = ImportError("libcudart.so.12: cannot open shared object file:\nNo such file", name="t")
    assert why_not_there(broken, "torch", "besman[lstm]") == (
        "torch cannot be loaded: libcudart.so.12: cannot open shared object file: No such file"
    )
    other = ModuleNotFoundError("No module named 'sympy'", name="sympy")
    said = why_not_there(other, "torch", "besman[lstm]")
    assert said == "torch cannot be loaded: No module named 'sympy'"
    missing = ModuleNotFoundError("No module named 'torch.nn'", name="torch.nn")
    said = why_not_there(missing, "torch", "besman[lstm]")
    assert said == "torch is not installed; pip install 'besman[lstm]'"
