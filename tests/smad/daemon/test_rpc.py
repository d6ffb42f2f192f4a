"""The command server's words: any bytes give a call or an error reply, never an exception."""

import json
from typing import Any

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from smad import api
from smad.api import METHODS
from smad.daemon.command.rpc import Call, Decoder, error_reply, result_reply
from smad.daemon.errors import Refusal

ALL = Decoder()
STOPS = Decoder("stop")

JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=20),
    lambda inner: (
        st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=12), inner, max_size=4)
    ),
    max_leaves=12,
)
REQUESTS = st.fixed_dictionaries(
    {},
    optional={
        "jsonrpc": st.just("2.0") | JSON,
        "id": st.integers() | st.text(max_size=5) | JSON,
        "method": st.sampled_from([m.name for m in METHODS]) | st.text(max_size=10),
        "params": JSON
        | st.dictionaries(
            st.sampled_from(["trajectories", "i_x_A", "name", "value", "spring", "lease_s"]), JSON
        ),
    },
)


def judge_runs(answer: Call | bytes | None) -> Any:
    if answer is None or isinstance(answer, Call):
        return answer
    reply = json.loads(answer)
    assert reply["jsonrpc"] == "2.0"
    assert reply["error"]["message"]
    assert "\n" not in reply["error"]["message"]
    return reply


@settings(deadline=None, max_examples=400, derandomize=True)
@given(st.binary(max_size=300))
def test_any_bytes_give_an_answer(data: bytes) -> None:
    judge_runs(ALL.decode(data))
    judge_runs(STOPS.decode(data))


@settings(deadline=None, max_examples=600, derandomize=True)
@given(JSON | REQUESTS)
def test_any_json_gives_an_answer(value: Any) -> None:
    data = json.dumps(value).encode()
    judge_runs(ALL.decode(data))
    judge_runs(STOPS.decode(data))


def test_a_valid_request_becomes_a_typed_call() -> None:
    call = ALL.decode(b'{"jsonrpc":"2.0","id":3,"method":"params.get","params":{"name":"x"}}')
    assert isinstance(call, Call)
    assert call.params == api.GetParam(name="x")
    assert (call.id, call.wants_reply, call.method.name) == (3, True, "params.get")


def test_an_empty_list_of_parameters_says_that_there_are_none() -> None:
    call = STOPS.decode(b'{"jsonrpc":"2.0","id":3,"method":"disarm","params": [ ]}')
    assert isinstance(call, Call)
    assert call.params == api.Disarm()
    refused = ALL.decode(b'{"jsonrpc":"2.0","id":3,"method":"params.get","params":[]}')
    assert isinstance(refused, bytes)
    assert b"name" in refused


def test_a_request_without_an_id_wants_no_reply() -> None:
    call = ALL.decode(b'{"jsonrpc":"2.0","method":"disarm"}')
    assert isinstance(call, Call)
    assert not call.wants_reply


def code_of(text: str) -> Any:
    """The id and the code of the error reply to a message."""
    reply = judge_runs(ALL.decode(text.encode()))
    return reply["id"], reply["error"]["code"]


@pytest.mark.parametrize(
    "text",
    [
        '{"jsonrpc":"2.0","method":"nonsense"}',
        '{"jsonrpc":"2.0","method":"params.get"}',
        '{"jsonrpc":"2.0","method":"params.get","params":{"name":5}}',
        '{"jsonrpc":"2.0","method":"params.get","params":["encoder"]}',
        '{"jsonrpc":"2.0","method":"arm","params":{"hard":true}}',
        '{"method":"params.set","params":{"name":"a","value":1e999}}',
    ],
)
def test_a_notification_that_is_not_valid_gets_no_reply(text: str) -> None:
    assert ALL.decode(text.encode()) is None


@pytest.mark.parametrize(
    ("text", "call_id"),
    [
        ("[]", None),
        ('[{"jsonrpc":"2.0","id":1,"method":"status"}]', None),
        ("5", None),
        ("{}", None),
        ('{"jsonrpc":"2.0","id":7}', 7),
        ('{"jsonrpc":"2.0","id":7,"method":5}', 7),
        ('{"jsonrpc":"2.0","method":1,"params":"bar"}', None),
        ('{"jsonrpc":"1.0","id":"a","method":"status"}', "a"),
        ('{"jsonrpc":2.0,"id":7,"method":"status"}', 7),
        ('{"jsonrpc":"2.0","id":7,"method":"status","params":5}', 7),
        ('{"jsonrpc":"2.0","id":7,"method":"nonsense","params":null}', 7),
        ('{"jsonrpc":"2.0","id":7,"method":"status","extra":1}', 7),
        ('{"jsonrpc":"2.0","id":true,"method":"status"}', None),
        ('{"jsonrpc":"2.0","id":1.5,"method":"status"}', None),
        ('{"jsonrpc":"2.0","id":[1],"method":"status"}', None),
    ],
)
def test_what_is_no_request_has_a_code_of_its_own(text: str, call_id: int | str | None) -> None:
    assert code_of(text) == (call_id, -32600)


@pytest.mark.parametrize(
    ("text", "code"),
    [
        ('{"id":7,"method":"nonsense"}', -32601),
        ('{"id":7,"method":"params.get"}', -32602),
        ('{"id":7,"method":"params.get","params":[]}', -32602),
        ('{"id":7,"method":"params.get","params":{"nom":"a"}}', -32602),
        ('{"id":7,"method":"params.set","params":{"name":"a","value":1e999}}', -32602),
        ('{"id":null,"method":"nonsense"}', -32601),
    ],
)
def test_a_request_that_is_not_valid_keeps_its_id(text: str, code: int) -> None:
    assert code_of(text) == (json.loads(text)["id"], code)


def test_a_request_whose_id_is_null_wants_a_reply() -> None:
    call = ALL.decode(b'{"jsonrpc":"2.0","id":null,"method":"status"}')
    assert isinstance(call, Call)
    assert (call.id, call.wants_reply) == (None, True)


@pytest.mark.parametrize(
    ("text", "call_id"),
    [
        ('{"id":1,"id":2,"method":"status"}', None),
        ('{"id":1,"method":"status","method":"disarm"}', 1),
        ('{"id":1,"method":"status","m\\u0065thod":"disarm"}', 1),
        ('{"id":1,"method":"current","params":{"i_x_A":0.1,"i_x_A":4.0}}', 1),
        ('{"id":1,"method":"current","params":{"i_x_A":0.1,"i_x_A":400.0}}', 1),
        ('{"id":1,"method":"nonsense","params":{},"params":{}}', 1),
        (
            '{"id":1,"method":"move","params":{"trajectories":[{"kind":"samples",'
            '"t_s":[0, 1.5],"t_s":[0, 2.5e0],"displacement_mm":[0, -1]}]}}',
            1,
        ),
    ],
)
def test_a_name_given_twice_is_refused(text: str, call_id: int | None) -> None:
    assert code_of(text) == (call_id, -32600)
    assert "twice" in judge_runs(ALL.decode(text.encode()))["error"]["message"]


def test_the_same_name_in_two_objects_is_no_name_given_twice() -> None:
    pieces = '{"kind":"hold","duration_s":1},{"kind":"hold","duration_s":2}'
    text = f'{{"id":1,"method":"move","params":{{"trajectories":[{pieces}]}}}}'
    assert isinstance(ALL.decode(text.encode()), Call)


def test_a_text_that_looks_like_a_list_of_numbers_is_kept() -> None:
    call = ALL.decode(b'{"id":1,"method":"record.note","params":{"text":"[1, 2]"}}')
    assert isinstance(call, Call)
    assert call.params == api.AddNote(text="[1, 2]")


def test_a_message_that_is_too_long_is_told_its_size_and_the_limit() -> None:
    text = b'{"id":1,"method":"status"}'
    fits = text.ljust(api.LARGEST_MESSAGE)
    assert isinstance(ALL.decode(fits), Call)
    for decoder in (ALL, STOPS):
        error = judge_runs(decoder.decode(fits + b" "))["error"]
        assert error["code"] == -32600
        assert error["data"]["value"] == "65537 bytes"
        assert error["data"]["limit"] == "65536 bytes"


def test_the_reply_to_a_refused_request_carries_its_id_code_and_value() -> None:
    reply = judge_runs(ALL.decode(b'{"id":"a","method":"record.note","params":{"text":""}}'))
    assert reply["id"] == "a"
    assert reply["error"]["code"] == -32602
    assert reply["error"]["data"]["value"] == ""


def test_the_stop_channel_takes_stops_only() -> None:
    reply = judge_runs(STOPS.decode(b'{"id":1,"method":"arm"}'))
    assert "stop commands only" in reply["error"]["message"]
    assert "disarm" in reply["error"]["data"]["limit"]
    assert isinstance(STOPS.decode(b'{"id":1,"method":"estop"}'), Call)


def test_nan_and_infinity_are_refused_as_json_and_as_numbers() -> None:
    for text in ("NaN", "Infinity", "1e999"):
        data = f'{{"id":1,"method":"params.set","params":{{"name":"a","value":{text}}}}}'
        assert judge_runs(ALL.decode(data.encode()))["error"]["code"] in (-32700, -32602)


def test_deep_nesting_is_refused() -> None:
    judge_runs(ALL.decode(b"[" * 60_000))
    judge_runs(ALL.decode(b'{"method":"move","params":' + b'{"a":' * 10_000))


def test_a_batch_is_refused_with_a_hint() -> None:
    assert "not a batch" in judge_runs(ALL.decode(b'[{"method":"status"}]'))["error"]["message"]


def test_replies_are_json_whatever_value_was_refused() -> None:
    refusal = Refusal(api.Reason.INVALID, "cause", value=object(), limit=range(3))
    assert json.loads(error_reply(1, refusal))["error"]["data"]["limit"] == "range(0, 3)"
    text = result_reply(None, api.ConfigText(toml="a = 1"))
    assert msgspec.json.decode(text) == {"jsonrpc": "2.0", "id": None, "result": {"toml": "a = 1"}}
