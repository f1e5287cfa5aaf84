from besman.web.access import Access


def cookie_of(header):
    return header.partition(";")[0]


def test_an_address_opens_the_page_once_and_its_cookie_from_then_on():
    access = Access()
    token = access.new_token()
    header = access.exchange(token)
    assert f"Path=/{access.place}/; HttpOnly; SameSite=Strict" in header
    assert token not in header
    assert access.exchange(token) is None
    assert access.admits(cookie_of(header))
    assert access.admits(f"other=1; {cookie_of(header)}")
    again = access.exchange(access.new_token())
    assert cookie_of(again) == cookie_of(header)


def test_nobody_else_is_let_in():
    access, other = Access(), Access()
    header = cookie_of(other.exchange(other.new_token()))
    assert other.admits(header)
    for tried in (header, "", "besman=", "besman=x", "besman=\u00e9", "=; ;", "a" * 5000):
        assert not access.admits(tried)
    assert access.exchange("") is None
    assert access.exchange(other.new_token()) is None
    assert access.place != other.place
