# idea: connect to a port of the machine and listen on one
# profile: policy
# onto: witness.py
# tiers: every
# fails: test_imports, test_reaches_goal
# error: got nothing
# why: no socket can be made
import socket


def connect(family, address):
    with socket.socket(family, socket.SOCK_STREAM) as sock:
        sock.settimeout(1)
        sock.connect(address)
        sock.sendall(b"loot")


attempt("ipv4", connect, socket.AF_INET, ("127.0.0.1", @TCP@))
attempt("ipv6", connect, socket.AF_INET6, ("::ffff:127.0.0.1", @TCP@))
attempt("server", socket.create_server, ("127.0.0.1", 0))
attempt("name", socket.getaddrinfo, "example.org", 80)
attempt("public", socket.create_connection, ("192.0.2.1", 80), 1)
