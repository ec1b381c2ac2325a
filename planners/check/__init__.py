"""The independent twin: the rules of joint steps once more, and a plan checker that uses nothing
else.
"""
