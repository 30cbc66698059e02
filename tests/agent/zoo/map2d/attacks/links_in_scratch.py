# idea: links out of the scratch folder, for the judge to follow as it cleans up
# profile: policy
# onto: witness.py
# tiers: every
# fails: test_imports, test_reaches_goal
# error: got nothing
# error rlimits: got parent -> None
# why: links cannot be made, and are not followed
import os

os.chdir(os.environ["HOME"])
attempt("symlink", os.symlink, "@TARGET@", "out")
attempt("file link", os.symlink, "@TARGET@/kept.txt", "kept")
attempt("hard link", os.link, "@TARGET@/kept.txt", "hard")
attempt("fifo", os.mkfifo, "pipe")
attempt("device", os.mknod, "disk", 0o60666, os.makedev(8, 0))
attempt("parent", os.rename, "../scratch", "../work/scratch")
attempt("bind", os.chroot, ".")
