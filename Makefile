# What these commands run stands in README.md and in .ci/.
.PHONY: reproduce test verify environment

reproduce: environment
	@.venv/bin/tbdcore run
	@.venv/bin/tbdcore score

test:
	@sh .ci/test

verify:
	@sh .ci/verify

environment:
	@sh .ci/environment
