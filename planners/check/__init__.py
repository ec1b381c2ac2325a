"""The independent twin.

The rules of joint steps once more, and a plan checker that uses nothing else.
"""
