# idea: connect to a socket file and to an abstract name
# profile: policy
# onto: witness.py
# tiers: every
# fails: test_imports, test_reaches_goal
# error: got nothing
# why: no socket can be made
import socket


def connect(address):
    with socket.socket(socket.AF_UNIX) as sock:
        sock.connect(address)
        sock.sendall(b"loot")


attempt("file", connect, "@UNIX@")
attempt("abstract", connect, "\0tdac")
attempt("pair", socket.socketpair)
attempt("vsock", socket.socket, 40, socket.SOCK_STREAM)
