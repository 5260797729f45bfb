"""The server of a page: one browser of this machine that knows the secret, and nobody and nothing else."""

import json
import socket
import struct
from contextlib import suppress
from http.client import HTTPConnection
from threading import Thread
from time import sleep

import pytest

from balance.errors import DataError
from balance.report import loopback
from balance.report.loopback import LARGEST_BODY, Loopback

JSON = {"Content-Type": "application/json"}


@pytest.fixture(scope="module")
def server():
    """A server of a page, of a refusal, and of an action that gives back what it was given."""

    def refused(words):
        raise DataError(f"no {words['what']}")

    found = Loopback({"": lambda words: "<p>page", "refused": refused, "echo": dict}, {"act": dict})
    Thread(target=found.serve, daemon=True).start()
    yield found
    found.asked = float("-inf")


def asked(server, path, method="GET", body=None, **headers):
    """Status, headers and text of the answer."""
    connection = HTTPConnection("127.0.0.1", server.server_port, timeout=10)
    connection.request(method, path, body, {name.replace("_", "-"): value for name, value in headers.items()})
    answer = connection.getresponse()
    return answer.status, dict(answer.getheaders()), answer.read().decode()


def test_answers_who_knows_the_secret(server):
    """A page, a document with the words of the address, and no header that lets another site read either."""
    status, headers, text = asked(server, f"/{server.token}/")
    assert (status, text, headers["Content-Type"]) == (200, "<p>page", "text/html; charset=utf-8")
    assert not [name for name in headers if name.lower().startswith("access-control")]
    assert headers["Referrer-Policy"] == "no-referrer"
    assert json.loads(asked(server, f"/{server.token}/echo?a=1&b=%3C")[2]) == {"a": "1", "b": "<"}
    assert json.loads(asked(server, f"/{server.token}/echo?a=%E2%80%AE%07")[2]) == {"a": r"\x202e\x07"}
    assert server.server_address[0] == "127.0.0.1"


@pytest.mark.parametrize(
    ("path", "status"),
    [
        ("/", 403), ("/echo?a=1", 403), ("/{wrong}/", 403), ("/x/{token}/", 403), ("/{token}/../echo", 404),
        ("/{token}/..%2f..%2fetc%2fpasswd", 404), ("/{token}//etc/passwd", 404), ("/{token}/act", 404),
        ("/{token}/refused?what=run", 422), ("/{token}/refused", 400),
    ],
)  # fmt: skip
def test_refuses(server, path, status):
    """A wrong secret, a name that is no page, a path, an action that is only read; a refusal says why."""
    wrong = server.token[:-1] + ("A" if server.token[-1] != "A" else "B")
    found, _, text = asked(server, path.format(token=server.token, wrong=wrong))
    assert found == status
    assert "page" not in text or status == 404
    if status == 422:
        assert json.loads(text) == {"error": "no run"}


@pytest.mark.parametrize("host", ["example.org", "127.0.0.1", "127.0.0.1.example.org:{port}", "localhost:1"])
def test_refuses_a_foreign_host(server, host):
    """The name under which another site leads here, also with the secret."""
    assert asked(server, f"/{server.token}/", Host=host.format(port=server.server_port))[0] == 403


@pytest.mark.parametrize(
    ("headers", "body", "status"),
    [
        (JSON, '{"a": "b"}', 200), (JSON | {"Origin": "http://127.0.0.1:{port}"}, "{}", 200),
        (JSON | {"Origin": "https://example.org"}, "{}", 403), (JSON | {"Origin": "null"}, "{}", 403),
        (JSON | {"Origin": "http://["}, "{}", 403), (JSON | {"Content-Length": "9" * 5000}, "{}", 413),
        ({"Content-Type": "text/plain"}, "{}", 403), (JSON, "[1]", 400), (JSON, '{"a": 1}', 400), (JSON, "{", 400),
        (JSON, " " * (LARGEST_BODY + 1), 413),
    ],
)  # fmt: skip
def test_actions_are_json_of_our_pages(server, headers, body, status):
    """What a form of another site can send is refused, and what is too long before it is read."""
    sent = {name: value.replace("{port}", str(server.server_port)) for name, value in headers.items()}
    found, _, text = asked(server, f"/{server.token}/act", "POST", body, **sent)
    assert (found, text == body) == (status, status == 200)


@pytest.mark.parametrize("method", ["PUT", "DELETE", "OPTIONS", "HEAD"])
def test_nothing_but_get_and_post(server, method):
    """Other methods are not known."""
    assert asked(server, f"/{server.token}/", method)[0] == 501


def test_who_breaks_off_or_dribbles_is_no_concern(server, monkeypatch, capfd):
    """A connection that is reset says nothing on the terminal; a request that is not whole in time is dropped."""
    monkeypatch.setattr(loopback, "PATIENCE_S", 0.2)
    with socket.create_connection(server.server_address) as reset:
        reset.sendall(b"GET /")
        reset.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    with socket.create_connection(server.server_address, timeout=5.0) as slow, suppress(ConnectionError):
        for _ in range(20):
            slow.sendall(b"G")
            sleep(0.05)
        pytest.fail("the request went on")
    assert capfd.readouterr().err == ""


def test_a_port_that_is_taken_is_named(server):
    """Of another program, or of another viewer."""
    with pytest.raises(DataError, match=f"port {server.server_port} of this machine: .*; name another"):
        Loopback({}, port=server.server_port)


def test_ends_when_nobody_asks():
    """An idle server ends by itself."""
    Loopback({}).serve(idle=0.05)
