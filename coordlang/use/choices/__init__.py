"""What each robot may do under a sentence, whatever the others choose from theirs."""
