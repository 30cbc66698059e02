# idea: send a datagram
# profile: policy
# onto: witness.py
# tiers: every
# fails: test_imports, test_reaches_goal
# error: got nothing
# why: no socket can be made
import socket


def send(address):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        return sock.sendto(b"loot", address)


attempt("datagram", send, ("127.0.0.1", @UDP@))
attempt("broadcast", send, ("255.255.255.255", @UDP@))
attempt("raw", socket.socket, socket.AF_INET, socket.SOCK_RAW, 1)
attempt("packet", socket.socket, 17, socket.SOCK_RAW)
attempt("netlink", socket.socket, 16, socket.SOCK_RAW)
