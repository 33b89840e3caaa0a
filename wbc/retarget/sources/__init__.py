"""Readers of clips: BVH, C3D, AMASS and SMPL, key points; what is wrong in a file is mended and said, or refused."""
