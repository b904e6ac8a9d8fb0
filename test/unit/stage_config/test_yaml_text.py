"""YAML as plain values, in which no key stands twice."""

import pytest
import yaml

from stage_config import yaml_values

WITH_MERGES = "n: &n {p: 1, q: 1}\nm: &m {<<: *n, q: 2}\nb: {<<: *m, q: 3}\nc: {<<: *n, <<: *m}\n<<: *m\n"


@pytest.mark.parametrize("text", ["a: 1\nb: [2, {c: 3}]\n", "- {a: 1}\n- {a: 2}\n", "1: a\n'1': b\n", "", "3", WITH_MERGES])
def test_text_without_a_key_twice_is_as_yaml_has_it(text: str) -> None:
    assert yaml_values(text) == yaml_values(text.encode()) == yaml.safe_load(text)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("a: 1\nb: 2\na: 3\n", "key a stands in line 1, and again in line 3"),
        ("m:\n- {kind: cart, name: x, name: y}\n", "key name stands in line 2, and again in line 2"),
        ("a:\n  b:\n    c: 1\n    d: 1\n    c: 1\n", "key c stands in line 3, and again in line 5"),
        ("a: &m {q: 1}\nb: {<<: *m, q: 2, q: 3}\n", "key q stands in line 2, and again in line 2"),
    ],
)
def test_key_that_stands_twice_is_named_with_its_lines(text: str, said: str) -> None:
    with pytest.raises(yaml.YAMLError, match=f"^{said}$"):
        yaml_values(text)


@pytest.mark.parametrize("text", ["a: [1", "[1]: 2", "!!python/name:os.system a"])
def test_what_is_no_plain_yaml_is_an_error_as_before(text: str) -> None:
    with pytest.raises(yaml.YAMLError):
        yaml_values(text)
