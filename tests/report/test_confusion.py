from besman.report.confusion import confusion_table

RESULTS = {
    "recognize": {
        "confusion": {"a<b": {"a<b": 3, "unknown": 1}, "idle": {"idle": 2}},
        "per_class": {"a<b": 0.75, "idle": 1.0},
        "per_class_manual": {"a<b": 0.5},
    }
}


def test_counts_and_shares_stand_in_the_table():
    table = confusion_table(RESULTS)
    assert "<th>a&lt;b</th><th>idle</th><th>unknown</th>" in table
    assert '<td class="good">3</td><td class="soft">·</td><td class="bad">1</td>' in table
    assert "<td>75%</td><td>50%</td>" in table
    assert "<td>100%</td><td>-</td>" in table


def test_without_truth_there_is_no_table():
    assert confusion_table({}) == ""
    assert confusion_table({"recognize": {"counts": {"idle": 1}}}) == ""
