#include "results/report/html.h"

#include <algorithm>
#include <sstream>

#include "results/text/text.h"
#include "results/text/web_page.h"

namespace dreamsearch::results {
namespace {

std::string HtmlCell(const Cell& cell) {
  if (const auto* text = std::get_if<std::string>(&cell)) {
    return "<td>" + HtmlText(*text) + "</td>";
  }
  if (const auto* whole = std::get_if<std::int64_t>(&cell)) {
    return "<td class=\"number\">" + GroupDigits(*whole) + "</td>";
  }
  if (const auto* real = std::get_if<double>(&cell)) {
    return "<td class=\"number\">" + FormatNumber("%.4g", *real) + "</td>";
  }
  return "<td></td>";
}

std::string HtmlLines(const std::string& text) {
  std::istringstream lines(text);
  std::string html, line;
  while (std::getline(lines, line)) html += HtmlText(line) + "\n";
  return html;
}

}  // namespace

std::string Note(const std::string& text) {
  return "<p class=\"note\">" + HtmlText(text) + "</p>\n";
}

std::string HtmlTable(const Table& table, const std::string& caption) {
  std::string html =
      "<div class=\"wide\"><table><caption>" + HtmlText(caption) + "</caption><thead><tr>";
  for (std::size_t i = 0; i < table.columns.size(); ++i) {
    const bool numbers = std::any_of(table.rows.begin(), table.rows.end(),
                                     [i](const auto& row) { return IsNumber(row[i]); });
    html += std::string("<th scope=\"col\"") + (numbers ? " class=\"number\"" : "") + ">" +
            HtmlText(table.columns[i]) + "</th>";
  }
  html += "</tr></thead><tbody>\n";
  for (const auto& row : table.rows) {
    html += "<tr>";
    for (const Cell& cell : row) html += HtmlCell(cell);
    html += "</tr>\n";
  }
  return html + "</tbody></table></div>\n";
}

std::string Folded(const std::string& summary, const std::string& html) {
  return "<details><summary>" + HtmlText(summary) + "</summary>" + html + "</details>\n";
}

std::string Preformatted(const std::string& text) { return "<pre>" + HtmlLines(text) + "</pre>"; }

std::string Query(const std::string& sql) {
  return Folded("The query behind it", "<pre><code>" + HtmlLines(sql) + "</code></pre>");
}

std::string Picture(const Figure& figure, const std::string& about) {
  std::string svg = DrawSvg(figure);
  svg = svg.substr(std::min(svg.find("<svg"), svg.size()));
  if (svg.rfind("<svg", 0) == 0) {
    svg.insert(4, " role=\"img\" aria-label=\"" + HtmlText(about) + "\"");
  }
  return "<div class=\"static wide\">" + svg + "</div>\n";
}

std::string PngPicture(const std::string& png, const std::string& about) {
  return "<figure class=\"strip\"><img src=\"" + PngLink(png) + "\" alt=\"" + HtmlText(about) +
         "\"><figcaption>" + HtmlText(about) + "</figcaption></figure>\n";
}

std::string PictureWithoutScript(const Figure& figure, const std::string& about) {
  return "<noscript>" + Picture(figure, about) + "</noscript>\n";
}

}  // namespace dreamsearch::results
