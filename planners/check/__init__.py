"""The independent twin of grounding and composition: rules of joint steps, and a plan checker."""
