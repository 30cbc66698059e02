# idea: code that shows only to who reads the declared encoding; -*- coding: utf-7 -*-
# profile: policy
# fails: test_imports, test_hygiene[forbidden_calls], test_reaches_goal
# error: forbidden calls: line
# why: the tree is made from the bytes, by the encoding that they declare
# +AAo-import os+AAo-eval("os.fork()")+AAo-
def policy(obs):
    return 1.0, 1.0
