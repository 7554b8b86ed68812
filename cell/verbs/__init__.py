"""What each verb does, without the command line around it; imports views and all below."""
