"""What the commands of `tdac` do; each module is imported when it is used."""
